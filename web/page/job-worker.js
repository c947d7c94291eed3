// The Worker of a dry run: one job, on a machine of its own. It receives `{ module, job }`, then perhaps `{ cancel:
// true }`. It sends `{ progress }`, and at the end `{ result }`, `{ cancelled: true }` or `{ error }`.

import { runJob } from './job-run.js';

let cancelled = false;

async function run({ module, job }) {
  const began = performance.now();
  const progress = (progress) => {
    postMessage({ progress });
    return !cancelled;
  };
  const result = await runJob(module, job, progress);
  if (!result) return postMessage({ cancelled: true });
  result.tookMs = performance.now() - began;
  const { steps, path, speed, curves } = result;
  const arrays = [steps, path.vertices, path.samples, speed, ...curves.flatMap(({ velocity, acceleration, jerk }) => [velocity, acceleration, jerk])];
  postMessage({ result }, arrays.map((array) => array.buffer));
}

onmessage = ({ data }) => {
  if (data.cancel) cancelled = true;
  else run(data).catch((error) => postMessage({ error: String(error.message ?? error) }));
};
