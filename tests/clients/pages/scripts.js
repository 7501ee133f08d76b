// Classic scripts, for packages that are used in this way.
export const script = (src) => new Promise((done, failed) => {
  const element = document.createElement('script');
  element.onload = done;
  element.onerror = () => failed(new Error(`${src} cannot be loaded`));
  element.src = src;
  document.head.append(element);
});
