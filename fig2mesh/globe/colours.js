// Colours of parts: as drawn, or by what the drawing showed of them; and which part is looked at.
'use strict';

const OBSERVED = [0x2b / 255, 0x6c / 255, 0xb0 / 255];
const INFERRED = [0xe0 / 255, 0x7b / 255, 0x39 / 255];
const DIMMED = 0.4; // of the brightness of parts that are not the chosen one
const STRENGTH = 0.75; // of the observed colours over the drawing's own

// Where files say for each point of the surface whether the drawing showed it: a property texture called observed.
const perTexel = (model) => model.sceneGraph.components.structuralMetadata?.propertyTextures?.some((texture) => texture.properties.observed);

const glsl = (rgb) => `vec3(${rgb.map((c) => c.toFixed(4)).join(', ')})`;
const texelShader = () => new Cesium.CustomShader({
  // sRGB as the drawing's colours are given; the material's are linear.
  fragmentShaderText: `void fragmentMain(FragmentInput fsInput, inout czm_modelMaterial material) {
    vec3 evidence = mix(${glsl(INFERRED)}, ${glsl(OBSERVED)}, step(0.5, float(fsInput.metadata.observed)));
    material.diffuse = mix(material.diffuse, evidence, ${STRENGTH.toFixed(2)});
  }`,
});

// mode: 'drawn' or 'observed'; chosen: name of the part that others are dimmed for, or null
function paint(figure, mode, chosen) {
  const { Color, ColorBlendMode } = Cesium;
  const models = figure.models();
  const fine = mode === 'observed' && models.length > 0 && models.every(perTexel);
  const drawn = figure.drawn ?? models[0];
  if (!drawn) return 'none';
  if (fine && !drawn.customShader) drawn.customShader = texelShader();
  if (!fine && drawn.customShader) drawn.customShader = undefined;
  const mixed = mode === 'observed' && !fine;
  drawn.colorBlendMode = mixed ? ColorBlendMode.MIX : ColorBlendMode.HIGHLIGHT;
  if ('colorBlendAmount' in drawn) drawn.colorBlendAmount = STRENGTH;
  let shares = false;
  for (const feature of figure.features()) {
    const share = feature.getProperty('observedShare');
    shares ||= share !== undefined;
    const light = chosen === null || feature.getProperty('name') === chosen ? 1 : DIMMED;
    const base = mixed && share !== undefined ? OBSERVED.map((c, i) => c * share + INFERRED[i] * (1 - share)) : [1, 1, 1];
    feature.color = new Color(...base.map((c) => c * light), 1);
  }
  return fine ? 'texel' : shares ? 'part' : 'none';
}
