// Parses the choices of a setting from its description. A pure function.

/// Parses a description such as `0 off, 1 homing, 2 limit`. Returns a name for each whole number from `minimum` to
/// `maximum`, or `undefined`.
export function choices({ type, minimum, maximum, description = '' }) {
  if (type !== 'integer' || maximum - minimum > 5) return undefined;
  const names = [];
  for (let n = minimum; n <= maximum; n++) {
    const found = new RegExp(`(?:^|[ ,.(])${n} ([a-z][^,.:;]*)`, 'i').exec(description);
    if (!found) return undefined;
    names.push(found[1].trim());
  }
  return names;
}
