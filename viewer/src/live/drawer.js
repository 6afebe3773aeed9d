// What draws in this browser: "none" without WebGL, "software" without a graphics card, else "card".

const WITHOUT_CARD = /swiftshader|llvmpipe|software|basic render/i;

function drawer() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return "none";
  const told = gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return WITHOUT_CARD.test(name) ? "software" : "card";
}

export const DRAWER = drawer();
