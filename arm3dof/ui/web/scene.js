// The page of the 3-D view: MeshCat's viewer, a connection that heals, views, captions, replay.
// How the viewer draws is in drawing.js.
// It makes no request but to the server that sent it; opened from a file it makes none at all.
"use strict";

const $ = (selector) => document.querySelector(selector);

var viewer = new MeshCat.Viewer($("#view"), true, makeRenderer($("#view")));
["Grid", "Axes"].forEach((name) => viewer.set_property([name], "visible", false)); // until there is more
drawWithCare();
const OWN_NODES = new Set(Object.keys(viewer.scene_tree.children));
const FIELD_OF_VIEW = 32; // degrees
const LOOP_PAUSE = 1.0; // s between the end of a replay and its next start
const plain = new URLSearchParams(location.search).has("plain"); // inside another page
document.body.classList.toggle("plain", plain);

// The viewer fills its stage, which is the whole window or a part of a page.
const stageSize = () => [$("#stage").clientWidth, $("#stage").clientHeight];
viewer.set_3d_pane_size = function () {
  MeshCat.Viewer.prototype.set_3d_pane_size.call(this, ...stageSize());
};

// ---- camera: the scene's z is up; the camera's own frame has y up -----------------------------

const camera = {
  views: [],
  shown: 0,
  moved: false,

  load(message) {
    this.views = message.views;
    const bar = $("#views");
    bar.replaceChildren(...this.views.map((view, index) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = view.name;
      button.title = `${view.name} view (${index + 1})`;
      button.addEventListener("click", () => this.show(index));
      return button;
    }));
    const more = document.createElement("button");
    more.type = "button";
    more.textContent = "Scene";
    more.title = "Show or hide the parts of the scene";
    more.addEventListener("click", () => {
      const shown = document.body.classList.toggle("show-scene");
      more.setAttribute("aria-pressed", shown);
      if (shown) viewer.gui.open(); else viewer.gui.close();
    });
    bar.append(more);
    bar.hidden = false;
    if (!this.moved) this.show(0);
  },

  show(index) {
    const view = this.views[index];
    if (!view) return;
    this.shown = index;
    const [eye, target] = [view.eye, view.target].map(([x, y, z]) => new MeshCat.THREE.Vector3(x, z, -y));
    const [width, height] = stageSize();
    const aspect = width / height || 1;
    eye.sub(target).multiplyScalar(Math.max(1, (plain ? 1 : 1.25) / aspect)).add(target); // a phone stands back
    viewer.camera.fov = FIELD_OF_VIEW;
    viewer.camera.position.copy(eye);
    viewer.controls.target.copy(target);
    viewer.controls.update();
    viewer.set_dirty();
    [...$("#views").children].slice(0, this.views.length)
      .forEach((button, k) => button.setAttribute("aria-pressed", k === index));
  },
};
// Stand a little to the right of the cards, where they lie on the stage and it is wide enough.
function leaveRoom() {
  const [w, h] = stageSize();
  if ($("#stage").dataset.room === "left" && w > 900) viewer.camera.setViewOffset(w, h, -0.09 * w, 0.03 * h, w, h);
  else viewer.camera.clearViewOffset();
  viewer.set_dirty();
}
new ResizeObserver(() => {
  viewer.set_3d_pane_size();
  quality.apply();
  leaveRoom();
  if (!camera.moved && camera.views.length) camera.show(camera.shown);
}).observe($("#stage"));
viewer.controls.addEventListener("start", () => {
  camera.moved = true;
  document.querySelectorAll('#views [aria-pressed="true"]').forEach((button) => {
    if (button.textContent !== "Scene") button.setAttribute("aria-pressed", false);
  });
});

// ---- night: a dark background for a dark page, called by the page around this one ----------------

var night = { // var: the page around this one reaches it
  dark: false,
  sky: [[0.957, 0.969, 0.98], [0.13, 0.17, 0.21]], ground: [[0.79, 0.83, 0.87], [0.06, 0.08, 0.10]],

  set(dark) {
    this.dark = dark;
    document.body.classList.toggle("dark", dark);
    this.apply();
  },

  apply() {
    const k = this.dark ? 1 : 0;
    viewer.set_property(["Background"], "top_color", this.sky[k]);
    viewer.set_property(["Background"], "bottom_color", this.ground[k]);
    viewer.set_property(["floor", "disc"], "visible", !this.dark);
    backdrop.changes += 1;
    viewer.set_dirty();
  },
};

// ---- caption ----------------------------------------------------------------------------------

function showCaption(message) {
  const card = $("#caption");
  card.querySelector("h1").textContent = message.title;
  const verdict = $("#verdict");
  verdict.hidden = !message.verdict;
  verdict.textContent = message.verdict;
  verdict.classList.toggle("good", message.good);
  card.querySelector("dl").replaceChildren(...message.facts.flatMap(([name, value]) => {
    const [term, detail] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = name;
    detail.textContent = value;
    return [term, detail];
  }));
  card.hidden = false;
}

// ---- replay: poses of links at a fixed rate, shown frame by frame in double precision ---------

const player = {
  frames: 0, fps: 30, frame: 0, time: 0, speed: 1, playing: false, asked: 0, last: null, nodes: [], rows: [],
  watchers: [], // called with the time [s] of each frame that is shown

  load(message) {
    Object.assign(this, { frames: message.frames, fps: message.fps, message, time: 0, last: null });
    this.nodes = message.paths.map((path) => viewer.scene_tree.find(path.split("/").filter(Boolean)).object);
    $("#transport").hidden = this.frames < 2;
    $("#time").max = Math.max(0, this.frames - 1);
    this.makeRows(message.joints);
    if (this.frames > 0) this.show(0);
    const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.setPlaying(this.frames > 1 && !calm);
  },

  duration() { return (this.frames - 1) / this.fps; },

  // Show one frame: set the pose of every link, the slider and the table.
  show(frame) {
    this.frame = Math.max(0, Math.min(this.frames - 1, frame));
    const poses = this.message.poses;
    this.nodes.forEach((node, k) => {
      const at = 7 * (this.frame * this.nodes.length + k);
      node.position.set(poses[at], poses[at + 1], poses[at + 2]);
      node.quaternion.set(poses[at + 3], poses[at + 4], poses[at + 5], poses[at + 6]);
    });
    viewer.set_dirty();
    $("#time").value = this.frame;
    const now = this.frame / this.fps;
    $("#clock").textContent = `${now.toFixed(2)} / ${this.duration().toFixed(2)} s`;
    $("#time").setAttribute("aria-valuetext", `${now.toFixed(2)} seconds`);
    this.rows.forEach((row, k) => row(this.frame * this.rows.length + k));
    this.watchers.forEach((watch) => watch(now));
  },

  seek(frame) {
    this.setPlaying(false);
    this.show(frame);
    this.time = this.frame / this.fps;
  },

  setPlaying(playing) {
    cancelAnimationFrame(this.asked);
    if (playing) this.ask();
    this.playing = playing;
    this.last = null;
    const button = $("#play");
    button.classList.toggle("playing", playing);
    button.setAttribute("aria-label", playing ? "Pause" : "Play");
  },

  toggle() {
    if (!this.playing && this.frame === this.frames - 1) this.time = 0;
    this.setPlaying(!this.playing);
  },

  tick(now) {
    if (!this.playing) return;
    if (this.last !== null) this.time += this.speed * (now - this.last) / 1000;
    this.last = now;
    if (this.time > this.duration() + LOOP_PAUSE) this.time = 0;
    const frame = Math.min(this.frames - 1, Math.floor(this.time * this.fps + 1e-6));
    if (frame !== this.frame) this.show(frame);
    this.ask();
  },

  ask() { this.asked = requestAnimationFrame((now) => this.tick(now)); },

  makeRows(joints) {
    const cell = (row, text, kind) => {
      const made = row.insertCell();
      made.textContent = text;
      made.className = kind;
      return made;
    };
    const body = $("#joints tbody");
    body.replaceChildren();
    this.rows = joints.map((joint) => {
      const row = body.insertRow();
      cell(row, joint.name, "");
      const angle = cell(row, "", "number");
      const bar = document.createElement("div");
      const fill = document.createElement("i");
      bar.className = "bar";
      bar.append(fill);
      cell(row, "", "").append(bar);
      const torque = cell(row, "", "number");
      return (at) => {
        const tau = this.message.torque[at];
        const share = Math.max(-1, Math.min(1, tau / joint.limit)) || 0;
        angle.textContent = `${fixed(this.message.position[at], 1)} ${joint.unit}`;
        torque.textContent = `${fixed(tau, 2)} ${joint.effort}`;
        fill.style.left = `${50 + Math.min(0, 50 * share)}%`;
        fill.style.width = `${Math.abs(50 * share)}%`;
        fill.classList.toggle("hot", Math.abs(share) > 0.95);
      };
    });
    $("#joints").hidden = joints.length === 0;
  },
};
$("#play").addEventListener("click", () => player.toggle());
$("#time").addEventListener("input", (event) => player.seek(Number(event.target.value)));
$("#speed").addEventListener("change", (event) => { player.speed = Number(event.target.value); });
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, select")) return;
  if (event.key === " " && event.target.closest("button")) return; // it presses that button
  if (event.key === " ") player.toggle();
  else if (event.key === "ArrowLeft") player.seek(player.frame - 1);
  else if (event.key === "ArrowRight") player.seek(player.frame + 1);
  else if (/^[1-9]$/.test(event.key)) camera.show(Number(event.key) - 1);
  else return;
  event.preventDefault();
});

// ---- messages ---------------------------------------------------------------------------------

const pageCommands = {
  batch(command) {
    command.commands.forEach((each) => viewer.handle_command(each));
    united.unite();
    quality.light(command.commands);
  },
  caption: showCaption,
  views: (command) => camera.load(command),
  replay: (command) => player.load(command),
  report: () => {}, // shown by report.js, where there is one
};
viewer.handle_command = function (command) {
  const carryOut = pageCommands[command.type];
  if (carryOut) carryOut(command);
  else MeshCat.Viewer.prototype.handle_command.call(this, command);
  united.heed(command);
  backdrop.heed(command);
  region.heed(command);
};

function clearScene() {
  Object.keys(viewer.scene_tree.children).filter((name) => !OWN_NODES.has(name))
    .forEach((name) => viewer.delete_path([name]));
  player.load({ frames: 0, fps: 30, paths: [], joints: [] });
  ["#caption", "#views"].forEach((part) => { $(part).hidden = true; });
}

// ---- where messages come from: a server, or this very file ------------------------------------

function connect(attempt) {
  const address = new URL("scene", location.href);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(address);
  let fresh = true;
  let retry = attempt;
  socket.binaryType = "arraybuffer";
  socket.onmessage = (message) => {
    const wasFresh = fresh;
    if (fresh) { // the first message is the whole scene
      fresh = false;
      retry = 0;
      $("#status").hidden = true;
      clearScene();
    }
    viewer.handle_command_message(message);
    if (night.dark && wasFresh) night.apply();
  };
  socket.onclose = () => {
    $("#status").textContent = "Connection lost. Trying again …";
    $("#status").hidden = false;
    setTimeout(() => connect(retry + 1), Math.min(3000, 250 * 2 ** retry));
  };
}

async function unpack(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  viewer.handle_command_bytearray(new Uint8Array(await new Response(stream).arrayBuffer()));
}

window.addEventListener("DOMContentLoaded", () => { // every script of the page has run
  const embedded = $("#embedded-scene");
  if (embedded) unpack(embedded.textContent);
  else connect(0);
});
