// A CNCjs server of our own, and what it tells those that are connected to it.

'use strict';

const { spawn } = require('child_process');
const fs = require('fs');
const http = require('http');
const net = require('net');
const path = require('path');
const { once } = require('events');
const installed = require('./installed');
const { sleep, until } = require('./steps');

const HOST = '127.0.0.1';

/// A TCP port that nobody listens on.
async function freePort() {
  const probe = net.createServer().listen(0, HOST);
  await once(probe, 'listening');
  const { port } = probe.address();
  await new Promise((resolve) => probe.close(resolve));
  return port;
}

/// What the server answers to a POST of JSON.
function post(url, body) {
  const headers = { 'Content-Type': 'application/json' };
  return new Promise((resolve, reject) => {
    const request = http.request(url, { method: 'POST', headers }, (answer) => {
      let text = '';
      answer.on('data', (data) => (text += data));
      answer.on('end', () => resolve(text));
    });
    request.on('error', reject);
    request.end(body);
  });
}

module.exports = class Server {
  constructor(port, controllerType = 'TinyG') {
    this.port = port;
    this.controllerType = controllerType;
    /// Lines that came from the board.
    this.lines = [];
    this.reset();
  }

  log() {
    return `cncjs-${this.controllerType}.log`;
  }

  /// Forgets what is known of the board.
  reset() {
    this.isOpen = false;
    this.controller = { sr: {}, pwr: {}, qr: 0 };
    this.settings = {};
    this.sender = {};
    this.workflow = undefined;
  }

  get sr() {
    return this.controller.sr;
  }

  /// Starts the server and connects to it.
  async start() {
    const home = path.join(process.cwd(), `home-${this.controllerType}`);
    fs.mkdirSync(home, { recursive: true });
    const log = fs.openSync(this.log(), 'w');
    const tcp = await freePort();
    const program = path.join(path.dirname(installed.resolve('cncjs/package.json')), 'bin/cncjs');
    const args = [program, '--host', HOST, '--port', String(tcp), '--config', path.join(home, 'cncrc')];
    const options = { env: { ...process.env, HOME: home }, stdio: ['ignore', log, log] };
    this.child = spawn(process.execPath, args, options);
    this.child.on('exit', (code) => (this.exit = `exit code ${code}`));
    const url = `http://${HOST}:${tcp}`;
    const token = await this.signIn(url);
    this.socket = installed('socket.io-client')(url, { query: `token=${token}` });
    this.listen();
    await until(() => this.socket.connected);
    const { version } = installed('cncjs/package.json');
    return `cncjs ${version}, node ${process.version}`;
  }

  /// Nobody has an account, so that everybody gets a token; as soon as the server listens.
  async signIn(url) {
    for (;;) {
      if (this.exit) throw new Error(`the server has ended: ${this.exit}`);
      try {
        return JSON.parse(await post(`${url}/api/signin`, '{}')).token;
      } catch {
        await sleep(200);
      }
    }
  }

  listen() {
    const on = (event, handle) => this.socket.on(event, handle);
    on('serialport:open', () => (this.isOpen = true));
    on('serialport:close', () => (this.isOpen = false));
    on('serialport:read', (line) => this.lines.push(line));
    on('controller:state', (_, state) => (this.controller = state));
    on('controller:settings', (_, settings) => (this.settings = settings));
    on('sender:status', (status) => {
      this.sender = status;
      this.answered = Math.max(this.answered, status.received);
    });
    on('workflow:state', (state) => (this.workflow = state));
  }

  /// Opens the serial port with the controller.
  async open() {
    this.reset();
    const options = { controllerType: this.controllerType, baudrate: 115200, rtscts: false };
    await this.call('open', this.port, options);
    await until(() => this.isOpen);
  }

  async close() {
    await this.call('close', this.port);
    await sleep(300); // The simulated board looks now and then whether somebody has the port open.
    return 'port closed';
  }

  /// What it has complained of in its log.
  complaints() {
    const lines = fs.readFileSync(this.log(), 'utf8').split('\n');
    return lines.filter((line) => /Expression:|error/.test(line));
  }

  async load(name, gcode) {
    /// Lines of the program that have been answered, also when it has ended and is wound back.
    this.answered = 0;
    await this.call('command', this.port, 'gcode:load', name, gcode, {});
  }

  command(...words) {
    this.socket.emit('command', this.port, ...words);
  }

  /// A line as from its console.
  type(line) {
    this.socket.emit('writeln', this.port, line);
  }

  call(...words) {
    return new Promise((resolve, reject) => {
      this.socket.emit(...words, (error) => (error ? reject(new Error(String(error))) : resolve()));
    });
  }

  /// Ends the server.
  async stop() {
    if (this.socket) this.socket.close();
    if (!this.child || this.exit) return;
    this.child.kill();
    const gone = await Promise.race([once(this.child, 'exit'), sleep(3000)]);
    if (!gone) this.child.kill('SIGKILL');
  }
};
