// Loads what is installed where the tests are run, which is not where they lie.

'use strict';

const { createRequire } = require('module');
const path = require('path');

module.exports = createRequire(path.join(process.cwd(), 'package.json'));
