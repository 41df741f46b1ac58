// The asset before a camera: framed, lit evenly from all sides, drawn when something changes and not otherwise.
import { Box3, Group, NeutralToneMapping, PerspectiveCamera, PMREMGenerator, Scene, Sphere, Vector3, WebGLRenderer } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { RoomEnvironment } from 'three/addons/environments/RoomEnvironment.js';

const FOV = 35; // degrees, of the shorter side of the view
const FROM = new Vector3(0.5, 0.4, 0.77).normalize();
const ROOM = 1.15; // around the sphere that holds the asset: its corners reach the sphere, and there are words
const TURN = Math.PI / 24;
const ZOOM = 0.9;

/** A renderer on a canvas. Throws where there is no WebGL. */
export function rendererOn(canvas) {
  const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
  renderer.toneMapping = NeutralToneMapping;
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  return renderer;
}

/** Put an object on the stage; what is given back draws, turns, zooms and frames it. */
export function stageOf(renderer, object) {
  const scene = new Scene();
  scene.environmentIntensity = 0.6; // at 1, white surfaces are beyond white, and faint occlusion is lost in it
  scene.environment = surroundings(renderer);
  scene.add(atUnitSize(object));
  const camera = new PerspectiveCamera(FOV, 1, 0.01, 100);
  const controls = new OrbitControls(camera, renderer.domElement);
  controls.minDistance = 0.05;
  controls.maxDistance = 50;
  controls.zoomToCursor = true;

  let waiting = false;
  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      controls.update();
      const distance = camera.position.length(); // the asset lies in the unit sphere
      camera.near = Math.max(distance - 1.05, distance / 500, 0.001);
      camera.far = distance + 1.05;
      camera.updateProjectionMatrix();
      renderer.render(scene, camera);
    });
  }
  function frame() {
    const half = (Math.min(camera.fov, horizontal(camera)) * Math.PI) / 360;
    controls.target.set(0, 0, 0);
    camera.position.copy(FROM).multiplyScalar(ROOM / Math.sin(half));
    draw();
  }
  function resize() {
    const { clientWidth: width, clientHeight: height } = renderer.domElement;
    renderer.setSize(width, height, false);
    camera.aspect = width / Math.max(height, 1);
    draw();
  }
  controls.addEventListener('change', draw);
  new ResizeObserver(resize).observe(renderer.domElement);
  resize();
  frame();
  return {
    draw,
    frame,
    turn: (right, up) => (controls.rotateLeft(right * TURN), controls.rotateUp(up * TURN), draw()),
    zoom: (steps) => (steps > 0 ? controls.dollyIn(ZOOM) : controls.dollyOut(ZOOM), draw()),
  };
}

/** An even room of soft lights; small, since without a graphics card the usual size takes seconds to prepare. */
function surroundings(renderer) {
  const generator = new PMREMGenerator(renderer);
  return generator.fromScene(new RoomEnvironment(), 0.04, 0.1, 100, { size: 64 }).texture;
}

/** The object in the unit sphere: whatever its size and place, nothing is lost in the 32 bits of a shader. */
function atUnitSize(object) {
  hideLights(object);
  object.updateMatrixWorld(true);
  const sphere = new Box3().setFromObject(object).getBoundingSphere(new Sphere());
  const pivot = new Group();
  const scale = sphere.radius > 0 ? 1 / sphere.radius : 1;
  pivot.scale.setScalar(scale);
  pivot.position.copy(sphere.center).multiplyScalar(-scale);
  pivot.add(object);
  return pivot;
}

// Lights of the asset are meant for its own world, and some of them are brighter than any screen.
function hideLights(object) {
  object.traverse((part) => {
    if (part.isLight) part.visible = false;
  });
}

function horizontal(camera) {
  return (2 * Math.atan(Math.tan((camera.fov * Math.PI) / 360) * camera.aspect) * 180) / Math.PI;
}
