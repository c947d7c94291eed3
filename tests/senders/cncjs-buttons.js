// What CNCjs's buttons do, beyond running a program.

'use strict';

const { NotYet, sleep, until, within, ensure } = require('./steps');

const READY = [1, 3, 4];
const HOMING = 9;
const FAR = 40;
/// Where Z is when it is homed, at its top, and where the plate is then.
const Z_TOP = 0;
const PLATE = -51.8;

/// The lines that come from the board from now on.
function hear(server) {
  const from = server.lines.length;
  return (start) => server.lines.slice(from).find((line) => line.startsWith(start));
}

/// Moves there and back, through its feeder.
async function jog(server) {
  for (const [line, end] of [['G0 X2', 2], ['G0 X-2', 0]]) {
    ['G91', line, 'G90'].forEach((text) => server.command('gcode', text));
    await until(() => Number(server.sr.mpos.x) === end && READY.includes(server.sr.machineState));
  }
  return 'X by 2 mm and back';
}

async function unlock(server) {
  const heard = hear(server);
  server.command('unlock');
  const answer = await until(() => heard('{"r":{"clear":'));
  ensure(answer.includes('"f":[1,0,'), answer);
  return answer;
}

/// Power of all motors, on and off.
async function motors(server) {
  const all = (power) => Object.values(server.controller.pwr).every((on) => Boolean(on) === power);
  server.command('energizeMotors:on');
  await until(() => all(true));
  server.command('energizeMotors:off');
  await until(() => all(false));
  return 'on and off';
}

async function override(server) {
  const heard = hear(server);
  server.command('feedOverride', 10);
  const answer = await until(() => heard('{"r":{"mfo":'));
  if (answer.includes('"f":[1,100,')) return new NotYet(`answered ${answer}`);
  await until(() => server.settings.mfo === 1.1);
  server.command('feedOverride', 0);
  await until(() => server.settings.mfo === 1);
  return '110 % and back';
}

/// Stops a program in the middle of a long move.
async function stop(server) {
  // Slow: the simulated board does not wait for the time to pass.
  await server.load('far', `G21 G90\nG1 X${FAR} F60\nM30\n`);
  server.command('gcode:start');
  await until(() => server.sr.velocity > 0);
  server.command('gcode:stop', { force: true });
  await until(() => server.workflow === 'idle');
  await until(() => server.sr.velocity === 0 && server.sr.machineState !== 5);
  const x = Number(server.sr.mpos.x);
  if (x === FAR) return new NotYet('the machine took no notice of ^D');
  await sleep(1000);
  ensure(x === Number(server.sr.mpos.x) && x < FAR, 'it moves on');
  server.command('unlock');
  await until(() => READY.includes(server.sr.machineState));
  return `at X ${x} of ${FAR}`;
}

/// Homes X and Y at their lower switches and Z at its upper one, which is where travel ends.
async function home(server) {
  server.command('homing');
  await until(() => server.sr.machineState === HOMING);
  await until(() => READY.includes(server.sr.machineState));
  const { x, y, z } = server.sr.mpos;
  ensure(Number(x) === 0 && Number(y) === 0 && Number(z) === Z_TOP, `at ${x} ${y} ${z}`);
  return `at ${x} ${y} ${z}`;
}

/// Probes the plate from above.
async function probe(server) {
  const heard = hear(server);
  server.command('gcode', `G38.2 Z-70 F800`);
  const result = await until(() => heard('{"r":{"prb":'));
  const { e, z } = JSON.parse(result).r.prb;
  ensure(e === 1 && Math.abs(z - PLATE) < 0.01, result);
  await until(() => READY.includes(server.sr.machineState));
  return `the plate is at Z ${z}`;
}

/// Ends in a board that has just started.
async function reset(server) {
  const heard = hear(server);
  server.command('reset');
  return until(() => heard('{"r":{"fv":'));
}

module.exports = { jog, unlock, motors, override, stop, home, probe, reset };
