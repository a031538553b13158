// How the viewer of scene.js draws: as well as the machine can, and as fast as what moves needs it.
"use strict";

// ---- the renderer: without a graphics card every picture is drawn by the processor -------------

function drawsInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl");
  const asked = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = asked ? gl.getParameter(asked.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

const software = drawsInSoftware();

function makeRenderer(host) {
  // smooth edges cost a processor as much as the picture: it draws a still one larger instead
  // and draws only what changes of a moving one
  const renderer = new MeshCat.THREE.WebGLRenderer({ antialias: !software, alpha: !software, preserveDrawingBuffer: software });
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = MeshCat.THREE.PCFSoftShadowMap;
  host.append(renderer.domElement);
  return renderer;
}

// ---- quality: where drawing is slow, what moves is drawn coarser and what rests in full ---------

var quality = { // var: a page around this one, and tests, reach it
  levels: [ // pixels drawn per pixel of the screen, along each side; whether shadows are cast
    { ratio: software ? 2 : 1, shadows: true },
    { ratio: 1, shadows: false },
    { ratio: 0.7, shadows: false },
    { ratio: 0.45, shadows: false },
  ],
  enough: 100_000, // pixels: so small a picture is not drawn coarser, for they are not what it costs
  slow: 40, // ms between two frames of a motion
  still: 1500, // ms without a new frame
  patience: 60, // frames in time after which a finer level is tried; twice as many after each
  least: software ? 1 : 0, level: 0, needed: software ? 1 : 0, late: 0, timely: 0, last: 0,

  // To be called before each frame of a motion.
  moves() {
    const now = performance.now();
    const interval = now - this.last;
    this.last = now;
    if (interval > this.still) return; // a single picture, not a motion
    [this.late, this.timely] = interval > this.slow ? [this.late + 1, 0] : [0, this.timely + 1];
    if (this.late > 4 && this.needed < this.levels.length - 1) {
      this.needed += 1;
      this.late = 0;
    } else if (this.timely > this.patience && this.needed > this.least) {
      this.needed -= 1;
      this.timely = 0;
      this.patience *= 2;
    }
    this.set(this.needed);
  },

  rests() { return performance.now() - this.last > this.still; },

  set(level) {
    if (level === this.level) return;
    this.level = level;
    this.apply();
  },

  // Lights that come with a batch of commands cast no shadows either where others do not.
  light(commands) { if (commands.some(({ path }) => path?.startsWith("/Lights"))) this.apply(); },

  apply() {
    const { ratio, shadows } = this.levels[this.level];
    const { clientWidth, clientHeight } = viewer.renderer.domElement.parentElement;
    const least = Math.sqrt(this.enough / (clientWidth * clientHeight)) / window.devicePixelRatio;
    viewer.renderer.setPixelRatio(window.devicePixelRatio * Math.max(ratio, Math.min(1, least)));
    viewer.scene.traverse((object) => {
      if (!object.isDirectionalLight) return;
      object.userData.casts ??= object.castShadow;
      object.castShadow = shadows && object.userData.casts;
    });
    united.show(this.level > 0);
  },
};

// Where one picture takes long, the page around it gets as much time as the picture took.
const breath = {
  long: 80, longest: 500, // ms
  until: 0,

  // The browser asks for the next frame when the last one is on the screen.
  begin() {
    const begun = performance.now();
    requestAnimationFrame((now) => {
      const took = now - begun;
      if (took > this.long) this.until = now + Math.min(took, this.longest);
    });
  },
};

// ---- shaders: one stays compiled though the last thing that uses it is drawn anew ----------------

const shaders = {
  kept: new Set(),

  keep() {
    viewer.scene.traverseVisible(({ material }) => {
      const program = material && viewer.renderer.properties.get(material).currentProgram;
      if (!program || this.kept.has(program.cacheKey)) return;
      this.kept.add(program.cacheKey);
      material.dispose = () => {};
    });
  },
};

// ---- united: the solids of one node, which hang together, are drawn in one go --------------------

const united = {
  fewest: 4, // solids that are worth it
  tiny: 0.08, // of the largest solid of its node
  wholes: new Map(), // by the path of the node
  touched: new Set(),

  // A command that changes a solid takes its node apart until the batch is through.
  heed({ type, path }) {
    if (!path) return;
    if (type === "delete") {
      for (const node of this.wholes.keys()) if (`${node}/`.startsWith(`${path}/`)) this.wholes.delete(node);
    }
    for (let node = above(path); node; node = above(node)) this.separate(node);
    if (type === "set_object") this.touched.add(above(path));
  },

  unite() {
    for (const path of this.touched) {
      const node = nodeAt(path);
      const solids = Object.values(node?.children ?? {}).map((child) => soleSolid(child.object)).filter(Boolean);
      if (solids.length < this.fewest) continue;
      const whole = merged(node.object, solids, ({ geometry }) => geometry);
      const coarse = merged(node.object, solids.filter(this.large(solids)), ({ geometry }) => coarser(geometry));
      node.object.add(whole, coarse);
      solids.forEach((solid) => { solid.visible = false; });
      this.wholes.set(path, { whole, coarse, solids });
    }
    this.touched.clear();
    this.show(quality.level > 0);
  },

  // What moves where drawing is slow has fewer sides and no tiny pieces.
  show(coarsely) {
    this.wholes.forEach(({ whole, coarse }) => {
      whole.visible = !coarsely;
      coarse.visible = coarsely;
    });
  },

  large(solids) {
    const sizes = new Map(solids.map((solid) => {
      solid.geometry.computeBoundingSphere();
      return [solid, solid.geometry.boundingSphere.radius];
    }));
    const least = this.tiny * Math.max(...sizes.values());
    return (solid) => sizes.get(solid) >= least;
  },

  separate(path) {
    const found = this.wholes.get(path);
    if (!found) return;
    this.wholes.delete(path);
    this.touched.add(path);
    for (const mesh of [found.whole, found.coarse]) {
      mesh.removeFromParent();
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    found.solids.forEach((solid) => { solid.visible = true; });
  },
};

const above = (path) => path.slice(0, Math.max(0, path.lastIndexOf("/")));

function nodeAt(path) {
  return path.split("/").filter(Boolean).reduce((node, name) => node?.children[name], viewer.scene_tree);
}

// The one opaque mesh below an object; none where there is anything else.
function soleSolid(object) {
  const found = [];
  object.traverse((each) => { if (each.material) found.push(each); });
  const [mesh] = found;
  const fits = found.length === 1 && mesh.isMesh && mesh.visible && mesh.geometry.index && mesh.geometry.attributes.normal
    && mesh.material.type === "MeshStandardMaterial" && !mesh.material.transparent && !mesh.material.vertexColors;
  return fits ? mesh : null;
}

// A geometry that looks the same from afar, with half the sides.
function coarser(geometry) {
  const { CylinderGeometry, SphereGeometry } = MeshCat.THREE;
  const { parameters: its, type } = geometry;
  const half = (sides) => Math.max(6, Math.round(sides / 2));
  if (type === "CylinderGeometry") {
    return new CylinderGeometry(its.radiusTop, its.radiusBottom, its.height, half(its.radialSegments), 1, its.openEnded);
  }
  if (type === "SphereGeometry") return new SphereGeometry(its.radius, half(its.widthSegments), half(its.heightSegments));
  return geometry;
}

// One mesh of several, each with the geometry that is asked for.
function merged(parent, solids, geometryOf) {
  const THREE = MeshCat.THREE;
  parent.updateWorldMatrix(true, true);
  const toParent = parent.matrixWorld.clone().invert();
  const parts = { position: [], normal: [], color: [] };
  const index = [];
  for (const solid of solids) {
    const geometry = geometryOf(solid).clone().applyMatrix4(toParent.clone().multiply(solid.matrixWorld));
    const first = parts.position.length / 3;
    for (const name of ["position", "normal"]) for (const value of geometry.attributes[name].array) parts[name].push(value);
    const { r, g, b } = solid.material.color;
    for (let k = 0; k < geometry.attributes.position.count; k += 1) parts.color.push(r, g, b);
    for (const corner of geometry.index.array) index.push(first + corner);
    geometry.dispose();
  }
  const geometry = new THREE.BufferGeometry();
  for (const name in parts) geometry.setAttribute(name, new THREE.Float32BufferAttribute(parts[name], 3));
  geometry.setIndex(index);
  const material = solids[0].material.clone();
  material.color.setScalar(1);
  material.vertexColors = true;
  material.side = Math.max(...solids.map((solid) => solid.material.side));
  const whole = new THREE.Mesh(geometry, material);
  whole.castShadow = whole.receiveShadow = true;
  return whole;
}

// ---- backdrop: the floor lies behind everything; while nobody turns the view it stays as drawn ----

const BEHIND = ["floor", "Lights"]; // nodes of the scene that make the backdrop

const backdrop = {
  picture: null, pixels: null, view: "", changes: 0, usable: false,

  // A command that changes what lies behind lets it be drawn anew.
  heed({ path }) {
    if (path && (BEHIND.includes(path.split("/")[1]) || path.startsWith("/Background"))) this.changes += 1;
  },

  // Draw a frame: what lies behind comes from the picture of it, where the view is as it was.
  draw(drawAll) {
    const { scene, camera, renderer } = viewer;
    const floor = viewer.scene_tree.children.floor?.object;
    const copies = software && renderer.capabilities.isWebGL2;
    if (!copies || quality.level === 0 || !floor || !scene.background) {
      region.whole = true;
      return drawAll();
    }
    viewer.controls.update();
    scene.updateMatrixWorld();
    camera.updateProjectionMatrix();
    const { width, height } = renderer.domElement;
    const view = [...camera.matrixWorld.elements, ...camera.projectionMatrix.elements,
      width, height, scene.background.uuid, this.changes].join();
    if (view !== this.view) {
      Object.assign(this, { view, usable: false });
      region.whole = true;
      return drawAll(); // it may turn on
    }
    if (!this.usable) this.take(width, height);
    const background = scene.background;
    scene.background = null;
    floor.visible = renderer.autoClear = scene.autoUpdate = false;
    try {
      const [things, area] = region.look(scene, camera, width, height);
      region.limit(area);
      renderer.clear();
      this.copy(this.picture, null, ...area);
      return region.draw(things, area, drawAll);
    } finally {
      scene.background = background;
      floor.visible = renderer.autoClear = scene.autoUpdate = true;
    }
  },

  take(width, height) {
    const { scene, camera, renderer } = viewer;
    const others = Object.entries(viewer.scene_tree.children)
      .filter(([name, { object }]) => !BEHIND.includes(name) && object.visible).map(([, { object }]) => object);
    others.forEach((object) => { object.visible = false; });
    renderer.render(scene, camera);
    others.forEach((object) => { object.visible = true; });
    this.resize(width, height);
    this.copy(null, this.picture, 0, 0, width, height);
    this.usable = region.whole = true;
  },

  resize(width, height) {
    const gl = viewer.renderer.getContext();
    if (!gl.isFramebuffer(this.picture)) {
      this.picture = gl.createFramebuffer();
      this.pixels = gl.createRenderbuffer();
    }
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.pixels);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, null);
    viewer.renderer.state.bindFramebuffer(gl.FRAMEBUFFER, this.picture);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, this.pixels);
    viewer.renderer.state.bindFramebuffer(gl.FRAMEBUFFER, null);
  },

  // Copy pixels as they are, which no shader does as fast; null is the canvas.
  copy(from, to, x, y, width, height) {
    const { state } = viewer.renderer;
    const gl = viewer.renderer.getContext();
    viewer.renderer.setRenderTarget(null);
    state.disable(gl.SCISSOR_TEST);
    state.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
    state.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
    const area = [x, y, x + width, y + height];
    gl.blitFramebuffer(...area, ...area, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    state.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
    state.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
  },
};

// ---- all of it, in the viewer --------------------------------------------------------------------

// The viewer asks for every frame of the screen; this lets it ask only where there is something to
// draw, for each costs the page some of its time.
function drawOnDemand() {
  let asked = false;
  const ask = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; viewer.animate(); });
  };
  viewer.animate = function () {
    this.animator.update(); // while it plays there is always more to draw
    if (this.needs_render) this.render();
    if (this.needs_render) ask();
  };
  viewer.set_dirty = function () {
    this.needs_render = true;
    ask();
  };
  viewer.animator.play = function () {
    Object.getPrototypeOf(this).play.call(this);
    viewer.set_dirty();
  };
  ask();
}

function drawWithCare() {
  const drawAll = () => MeshCat.Viewer.prototype.render.call(viewer);
  const draw = () => backdrop.draw(() => (quality.level > 0 ? corners.draw(viewer.scene, drawAll) : drawAll()));
  viewer.render = function () {
    if (performance.now() < breath.until) return; // it stays due
    breath.begin();
    quality.moves();
    draw();
    shaders.keep();
  };
  viewer.capture_image = function () { // in full, and before a coarser size clears the picture
    quality.set(0);
    draw();
    return this.renderer.domElement.toDataURL();
  };
  setInterval(() => {
    if (quality.level === 0 || !quality.rests()) return;
    quality.set(0);
    draw();
  }, 250);
  drawOnDemand();
}
