// A globe that asks nobody: the imagery that CesiumJS brings along, a smooth ellipsoid, no account, no services.
'use strict';

function offlineViewer(container, options = {}) {
  if (!window.Cesium) throw new Error('CesiumJS is not there: put the folder Build/Cesium of the npm package cesium beside this page, as "cesium".');
  Cesium.Ion.defaultAccessToken = undefined;
  const imagery = Cesium.TileMapServiceImageryProvider.fromUrl(Cesium.buildModuleUrl('Assets/Textures/NaturalEarthII'));
  return new Cesium.Viewer(container, {
    baseLayer: Cesium.ImageryLayer.fromProviderAsync(imagery),
    terrainProvider: new Cesium.EllipsoidTerrainProvider(),
    baseLayerPicker: false, geocoder: false, animation: false, timeline: false, homeButton: false,
    sceneModePicker: false, navigationHelpButton: false, infoBox: false, selectionIndicator: false,
    fullscreenButton: false, requestRenderMode: true, ...options,
  });
}
