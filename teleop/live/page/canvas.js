// Set the number of pixels of a canvas to the size of its box on the screen, up to a limit.

const MOST_PIXELS = 1.2e6; // largest number of pixels of one canvas, which limits the drawing time
const sizes = new ResizeObserver((entries) => {
  for (const entry of entries) entry.target.resized();
});

// Adapt the number of pixels of a canvas to its box, now and after each change of the box. A change of the number of
// pixels makes the canvas black. Therefore the function `draw` is called at once, before the browser shows the canvas.
export function fit(canvas, draw) {
  canvas.resized = () => {
    const { clientWidth, clientHeight } = canvas;
    if (!clientWidth || !clientHeight) return;
    const most = Math.sqrt(MOST_PIXELS / (clientWidth * clientHeight));
    const ratio = Math.min(devicePixelRatio || 1, 2, Math.max(most, 0.5));
    const width = Math.round(clientWidth * ratio);
    const height = Math.round(clientHeight * ratio);
    if (width === canvas.width && height === canvas.height) return;
    canvas.width = width;
    canvas.height = height;
    canvas.ratio = (ratio * rem()) / 16; // scale of lines and text, proportional to the size of the page's text
    draw();
  };
  sizes.observe(canvas);
  canvas.resized();
}

function rem() {
  return parseFloat(getComputedStyle(document.documentElement).fontSize);
}

export function clear(context, colour) {
  context.fillStyle = colour;
  context.fillRect(0, 0, context.canvas.width, context.canvas.height);
}
