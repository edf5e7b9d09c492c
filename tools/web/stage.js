// The 3-D stage of a report: figures from GLB files on a floor, at a time that the page chooses.
// Bundled with three.js by build.mjs; the page calls PhysiqueStage.createStage(canvas, options).
import {
  AmbientLight,
  AnimationMixer,
  Box3,
  CircleGeometry,
  Color,
  DataTexture,
  DirectionalLight,
  Fog,
  Group,
  HemisphereLight,
  LinearMipmapLinearFilter,
  Mesh,
  MeshBasicMaterial,
  NearestFilter,
  PCFShadowMap,
  PerspectiveCamera,
  RepeatWrapping,
  SRGBColorSpace,
  Scene,
  ShadowMaterial,
  SphereGeometry,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const VIEWS = {
  diagonal: new Vector3(0.62, 0.3, 1),
  front: new Vector3(0, 0.12, 1),
  side: new Vector3(1, 0.12, 0),
  top: new Vector3(0, 1, 0.001),
};
const BODY_HEIGHT = 1.9; // m, with some air above
const FLOOR = 40; // m, radius
const SAMPLES = 12; // moments of the motion at which figures are looked for
const BEHIND = 0.04; // m, that ghosts are drawn behind their place, so that bodies cover them

export async function createStage(canvas, { figures, onChange }) {
  const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: false });
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = PCFShadowMap;
  const scene = new Scene();
  scene.background = new Color();
  scene.fog = new Fog(0xffffff, 12, 34);
  const camera = new PerspectiveCamera(32, 1, 0.05, 80);
  const controls = new OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.maxPolarAngle = Math.PI * 0.55;
  controls.minDistance = 0.6;
  controls.maxDistance = 30;

  const sky = new HemisphereLight(0xffffff, 0x8a8078, 1.5);
  const sun = new DirectionalLight(0xffffff, 2.4);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.bias = -0.0004;
  sun.shadow.normalBias = 0.05;
  sun.shadow.radius = 3;
  scene.add(sky, sun, sun.target, new AmbientLight(0xffffff, 0.15));

  const disc = new CircleGeometry(FLOOR, 64).rotateX(-Math.PI / 2);
  const shade = new Mesh(disc, new ShadowMaterial());
  shade.position.y = 0.002;
  shade.receiveShadow = true;
  const tiles = checks(renderer.capabilities.getMaxAnisotropy());
  const floor = new Mesh(disc, new MeshBasicMaterial({ map: tiles }));
  scene.add(floor, shade);

  const actors = [];
  for (const figure of figures) actors.push(await loadActor(figure));
  for (const actor of actors) scene.add(actor.group);
  const duration = Math.max(...actors.map((actor) => actor.duration));

  const state = { time: 0, surface: "skin", ghost: true, follow: true, effort: true, focus: null };
  const center = new Vector3();
  const moved = new Vector3();

  function place() {
    for (const actor of actors) actor.pose(state.time);
  }

  // Where the eye looks: the middle of the figures' hips, or of the one in focus, with its recording.
  function middle(into) {
    const seen = state.focus === null ? actors : [actors[state.focus]];
    const box = new Box3();
    const at = new Vector3();
    const hips = seen.flatMap((actor) => actor.hips.slice(0, state.ghost ? 2 : 1));
    for (const node of hips) box.expandByPoint(node.getWorldPosition(at));
    box.getCenter(into);
    into.y = 0.5 * into.y + 0.34;
    return { into, width: box.max.x - box.min.x, depth: box.max.z - box.min.z };
  }

  function follow() {
    if (!state.follow) return;
    const before = center.clone();
    middle(center);
    moved.subVectors(center, before);
    controls.target.add(moved);
    camera.position.add(moved);
  }

  function render() {
    sun.target.position.copy(controls.target).setY(0);
    sun.position.copy(sun.target.position).add(new Vector3(2.2, 5, 3));
    const reach = 3 + 0.5 * spread();
    Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
    sun.shadow.camera.updateProjectionMatrix();
    renderer.render(scene, camera);
    onChange?.();
  }

  function spread() {
    const xs = actors.map((actor) => actor.group.position.x);
    return Math.max(...xs) - Math.min(...xs);
  }

  function setTime(time) {
    state.time = time;
    place();
    follow();
    render();
  }

  // The most room that the figures in view ever take, seen from above.
  function room() {
    const most = { width: 0, depth: 0 };
    for (let i = 0; i <= SAMPLES; i++) {
      for (const actor of actors) actor.pose((i / SAMPLES) * duration);
      const { width, depth } = middle(center);
      most.width = Math.max(most.width, width);
      most.depth = Math.max(most.depth, depth);
    }
    place();
    return most;
  }

  // Stand back as far as all figures in view need.
  function look(view) {
    const { width, depth } = room();
    middle(center);
    const direction = VIEWS[view].clone().normalize();
    const across = Math.abs(direction.z) * width + Math.abs(direction.x) * depth + 1.4;
    const toward = Math.abs(direction.x) * width + Math.abs(direction.z) * depth;
    const half = Math.tan((camera.fov * Math.PI) / 360);
    const distance = Math.max((1.34 * BODY_HEIGHT) / (2 * half), across / (2 * half * camera.aspect));
    controls.target.copy(center);
    camera.position.copy(center).addScaledVector(direction, distance + toward / 2);
    controls.update();
    render();
  }

  function resize() {
    const { clientWidth: width, clientHeight: height } = canvas;
    if (width === 0 || height === 0) return;
    renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    render();
  }

  function theme({ background, tile, shadow }) {
    scene.background.set(background);
    scene.fog.color.set(background);
    paintChecks(tiles, background, tile);
    shade.material.opacity = shadow;
    render();
  }

  function set(name, value) {
    state[name] = value;
    for (const actor of actors) actor.show(state);
    if (name === "focus" || name === "follow" || name === "ghost") {
      middle(center);
      if (state.follow) {
        moved.subVectors(center, controls.target);
        controls.target.add(moved);
        camera.position.add(moved);
        controls.update();
      }
    }
    render();
  }

  controls.addEventListener("change", render);
  place();
  for (const actor of actors) actor.show(state);
  middle(center);
  return { setTime, look, resize, theme, set, effort: (i, use) => actors[i].effort(use), render };
}

async function loadActor({ glb, shift, colour }) {
  const gltf = await new GLTFLoader().parseAsync(glb, "");
  const group = new Group();
  group.position.fromArray(shift);
  group.add(gltf.scene);
  const mixer = new AnimationMixer(gltf.scene);
  const clip = gltf.animations[0];
  const action = mixer.clipAction(clip);
  action.play();

  const surfaces = [];
  const joints = {};
  const hips = []; // of the simulated figure and of its recording
  gltf.scene.traverse((node) => {
    const { associations } = gltf.parser;
    const index = associations.get(node)?.nodes;
    const name = index === undefined ? "" : gltf.parser.json.nodes[index].name;
    if (name === "pelvis") hips.push(node);
    if (node.isBone) joints[name] ??= node; // the first skeleton is the simulated one
    if (!node.isMesh) return;
    node.frustumCulled = false; // bounds of a skin are those of its rest pose
    const ghost = node.material.transparent;
    node.castShadow = !ghost;
    node.receiveShadow = !ghost;
    node.renderOrder = ghost ? 1 : 0;
    if (ghost) {
      // Only the outermost surface shows, not what is behind it inside the body.
      node.material.depthWrite = true;
      drawBehind(node.material);
    }
    const kind = node.isSkinnedMesh ? "skin" : node.name.startsWith("held_") ? "held" : "capsules";
    if (!ghost && kind !== "held") node.material.color.set(colour);
    surfaces.push({ node, ghost, kind });
  });
  const skinned = surfaces.some(({ kind }) => kind === "skin");
  const byName = Object.keys(joints).length ? joints : nodesByName(gltf);
  const lamps = Object.entries(byName).map(([name, joint]) => ({ name, joint, lamp: makeLamp() }));
  for (const { joint, lamp } of lamps) joint.add(lamp);

  return {
    group,
    hips,
    duration: clip.duration,
    pose(time) {
      action.time = Math.min(time, clip.duration * (1 - 1e-6));
      mixer.update(0);
      group.updateMatrixWorld(true);
    },
    show(state) {
      const wanted = skinned ? state.surface : "capsules";
      for (const { node, ghost, kind } of surfaces) {
        node.visible = (kind === wanted || kind === "held") && (!ghost || state.ghost);
      }
      for (const { lamp } of lamps) lamp.userData.allowed = state.effort;
    },
    // use: of each joint by name, 1 where it gives all it has.
    effort(use) {
      for (const { name, lamp } of lamps) {
        const share = use[name] ?? 0;
        lamp.visible = lamp.userData.allowed && share >= 0.9;
        lamp.scale.setScalar(share >= 0.99 ? 1 : 0.6);
        lamp.material.opacity = share >= 0.99 ? 0.85 : 0.4;
      }
    },
  };
}

function nodesByName(gltf) {
  const found = {};
  gltf.scene.traverse((node) => {
    const index = gltf.parser.associations.get(node)?.nodes;
    if (index !== undefined) found[gltf.parser.json.nodes[index].name] ??= node;
  });
  return found;
}

// A joint at its limit shines through the skin.
function makeLamp() {
  const material = new MeshBasicMaterial({ color: 0xe5243b, transparent: true, depthTest: false });
  const lamp = new Mesh(new SphereGeometry(0.045, 16, 12), material);
  lamp.renderOrder = 3;
  lamp.visible = false;
  return lamp;
}

// Squares of half a metre; those of the floor under the world's origin meet there.
function checks(anisotropy) {
  const texture = new DataTexture(new Uint8Array(16), 2, 2);
  texture.colorSpace = SRGBColorSpace;
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.repeat.setScalar(2 * FLOOR);
  texture.magFilter = NearestFilter;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.anisotropy = anisotropy;
  return texture;
}

function paintChecks(texture, ...pair) {
  const [a, b] = pair.map((css) => {
    const hex = new Color(css).getHex();
    return [hex >> 16, (hex >> 8) & 255, hex & 255, 255];
  });
  texture.image.data.set([...a, ...b, ...b, ...a]);
  texture.needsUpdate = true;
}

// Ghosts stand where the body does: without this the two surfaces would mix in patches.
function drawBehind(material) {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader.replace(
      "#include <project_vertex>",
      `#include <project_vertex>
      vec4 behind = projectionMatrix * (mvPosition - vec4(0.0, 0.0, ${BEHIND.toFixed(3)}, 0.0));
      gl_Position.z = behind.z / behind.w * gl_Position.w;`,
    );
  };
}
