// Where the picture of drawing.js changes between two frames of a motion: only there is it drawn
// anew, for a processor pays for every pixel and for every corner of what it draws.
"use strict";

const region = {
  MARGIN: 2, // pixels around what has changed: lines have a width
  whole: true, // whether all of the next picture is drawn anew
  drawn: new Map(), // by what was drawn: where in the picture, and how it stood

  // A command that changes how things look, rather than where they are, lets all be drawn anew.
  heed({ type, path, property }) {
    if (path?.startsWith("/Lights") || (type === "set_property" && property !== "visible")) this.whole = true;
  },

  // Return all that is to be seen, and where it or its absence is news: x, y, width and height in
  // pixels from the lower left.
  look(scene, camera, width, height) {
    const toPicture = new MeshCat.THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const before = this.drawn, now = new Map(), all = [0, 0, width, height];
    let area = this.whole || viewer.animator.playing ? all : null;
    scene.traverseVisible((thing) => {
      if (!thing.material) return;
      const last = before.get(thing);
      before.delete(thing);
      const stays = last && last.geometry === thing.geometry && last.material === thing.material
        && last.world.equals(thing.matrixWorld);
      if (stays && !this.whole) return now.set(thing, last);
      const place = { geometry: thing.geometry, material: thing.material, world: thing.matrixWorld.clone(),
        box: this.box(thing, toPicture, width, height) ?? all };
      now.set(thing, place);
      area = around(around(area, place.box), last?.box);
    });
    before.forEach(({ box }) => { area = around(area, box); });
    Object.assign(this, { drawn: now, whole: false });
    return [[...now.keys()], this.grown(area ?? all)]; // where nothing is news, who asks knows of some
  },

  // Return an area with all of the see-through things that reach into it: drawn twice they would be
  // darker, and SwiftShader lets pixels of tiny triangles slip out of the area.
  grown(area) {
    const clear = [...this.drawn.values()].filter(({ material }) => material.transparent).map(({ box }) => box);
    const more = clear.filter((box) => meet(box, area)).reduce(around, area);
    return more.every((number, k) => number === area[k]) ? area : this.grown(more);
  },

  // The box around a thing in the picture; nothing where that is not to be told.
  box({ geometry, matrixWorld, isMesh, isLine, isInstancedMesh, isSkinnedMesh }, toPicture, width, height) {
    if (!(isMesh || isLine) || isInstancedMesh || isSkinnedMesh) return undefined;
    if (!geometry.boundingBox) geometry.computeBoundingBox();
    const { min, max } = geometry.boundingBox;
    const e = new MeshCat.THREE.Matrix4().multiplyMatrices(toPicture, matrixWorld).elements;
    let [left, low, right, high] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let corner = 0; corner < 8; corner += 1) {
      const [x, y, z] = [corner & 1 ? max.x : min.x, corner & 2 ? max.y : min.y, corner & 4 ? max.z : min.z];
      const depth = e[3] * x + e[7] * y + e[11] * z + e[15];
      if (!(depth > 1e-6)) return undefined; // beside or behind the eye, or without corners
      const u = (e[0] * x + e[4] * y + e[8] * z + e[12]) / depth, v = (e[1] * x + e[5] * y + e[9] * z + e[13]) / depth;
      [left, low, right, high] = [Math.min(left, u), Math.min(low, v), Math.max(right, u), Math.max(high, v)];
    }
    const from = (share, size) => Math.max(0, Math.min(size, Math.floor((share + 1) / 2 * size) - this.MARGIN));
    const to = (share, size) => Math.max(0, Math.min(size, Math.ceil((share + 1) / 2 * size) + this.MARGIN));
    const [x, y] = [from(left, width), from(low, height)];
    return [x, y, to(right, width) - x, to(high, height) - y];
  },

  // Draw inside an area only, of the things only those that reach into it.
  draw(things, area, drawAll) {
    const { renderer } = viewer;
    const aside = things.filter((thing) => !meet(this.drawn.get(thing).box, area));
    const layers = aside.map((thing) => thing.layers.mask);
    aside.forEach((thing) => { thing.layers.mask = 0; });
    try {
      return drawAll();
    } finally {
      aside.forEach((thing, k) => { thing.layers.mask = layers[k]; });
      renderer.setScissorTest(false);
    }
  },

  // Let the renderer leave all pixels outside an area alone.
  limit([x, y, width, height]) {
    const { renderer } = viewer;
    const ratio = renderer.getPixelRatio(); // it counts in pixels of the page, and rounds down
    renderer.setScissor(...[x, y, width, height].map((pixels) => (pixels + 0.5) / ratio));
    renderer.setScissorTest(true);
  },
};

// The box around two boxes, of which any may be missing.
function around(one, two) {
  if (!one || !two) return one ?? two;
  const [x, y] = [Math.min(one[0], two[0]), Math.min(one[1], two[1])];
  return [x, y, Math.max(one[0] + one[2], two[0] + two[2]) - x, Math.max(one[1] + one[3], two[1] + two[3]) - y];
}

const meet = ([x, y, width, height], [left, low, wide, high]) => x < left + wide && left < x + width && y < low + high && low < y + height;
