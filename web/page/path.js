// Computes the path to draw from samples of steps. Pure functions that run in a Worker.

/// Leaves out samples that lie on a straight line between others, to within a step. Returns the vertices, and the
/// sample of each vertex.
///
/// `steps` has four numbers for each sample. `axes` has, for X, Y and Z, the motor, the length of a step in mm, and the
/// origin.
export function pathOf(steps, axes) {
  const count = steps.length / 4;
  const at = (i, axis) => (axes[axis] ? steps[4 * i + axes[axis].motor] * axes[axis].scale + axes[axis].origin : 0);
  const tolerance = Math.max(0.008, ...axes.map((axis) => (axis ? Math.abs(axis.scale) * 0.9 : 0)));
  const vertices = [];
  const samples = [];
  const keep = (i) => {
    if (samples.at(-1) === i) return;
    vertices.push(at(i, 0), at(i, 1), at(i, 2));
    samples.push(i);
  };
  if (count === 0) return { vertices: new Float32Array(), samples: new Uint32Array() };
  keep(0);
  let anchor = [at(0, 0), at(0, 1), at(0, 2)];
  let direction;
  let reach = 0;
  for (let i = 1; i < count; i++) {
    const p = [at(i, 0) - anchor[0], at(i, 1) - anchor[1], at(i, 2) - anchor[2]];
    const length = Math.hypot(...p);
    if (!direction) {
      if (length > 4 * tolerance) {
        direction = p.map((x) => x / length);
        reach = length;
      }
      continue;
    }
    const along = p[0] * direction[0] + p[1] * direction[1] + p[2] * direction[2];
    const off = Math.sqrt(Math.max(0, length * length - along * along));
    // Long lines keep some samples, so that the colour can change along them.
    if (off <= tolerance && along >= reach - tolerance && i - samples.at(-1) < 25) {
      reach = Math.max(reach, along);
      continue;
    }
    keep(i - 1);
    anchor = [at(i - 1, 0), at(i - 1, 1), at(i - 1, 2)];
    direction = undefined;
    reach = 0;
  }
  keep(count - 1);
  return { vertices: Float32Array.from(vertices), samples: Uint32Array.from(samples) };
}
