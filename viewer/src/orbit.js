// Fingers and mouse turn the camera; two fingers, or the wheel with Ctrl, bring it closer.

const TURN_RAD_PX = 0.008;

export function orbit(surface, camera, turned) {
  const fingers = new Map();
  let apart = 0;

  const gap = () => {
    const [one, other] = [...fingers.values()];
    return Math.hypot(one.x - other.x, one.y - other.y);
  };

  surface.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    surface.setPointerCapture(event.pointerId);
    if (fingers.size === 2) apart = gap();
  });
  surface.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size === 1) camera.turn(-TURN_RAD_PX * (event.clientX - before.x), TURN_RAD_PX * (event.clientY - before.y));
    else if (fingers.size === 2) {
      camera.closer(gap() / (apart || 1));
      apart = gap();
    }
    turned();
  });
  for (const end of ["pointerup", "pointercancel"]) surface.addEventListener(end, (event) => fingers.delete(event.pointerId));
  surface.addEventListener(
    "wheel",
    (event) => {
      // the plain wheel scrolls the page
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      camera.closer(Math.exp(-0.002 * event.deltaY));
      turned();
    },
    { passive: false },
  );
}
