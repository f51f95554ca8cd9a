// Checks a message against the server's own JSON schema: both sides mean the same, or say where not.

/** Return where a value does not fit a schema, "" where it does. Of long lists of numbers only the ends are looked at. */
export function fault(value, schema, root = schema, at = "message") {
  if (schema.$ref) return fault(value, root.$defs[schema.$ref.split("/").pop()], root, at);
  if (schema.discriminator) {
    const found = schema.discriminator.mapping[value?.[schema.discriminator.propertyName]];
    return found ? fault(value, { $ref: found }, root, at) : `${at}: unknown kind ${value?.kind}`;
  }
  if (schema.anyOf) {
    const faults = schema.anyOf.map((one) => fault(value, one, root, at));
    return faults.includes("") ? "" : faults[0];
  }
  if (schema.enum && !schema.enum.includes(value)) return `${at}: ${value} is none of ${schema.enum}`;
  if ("const" in schema && schema.const !== value) return `${at}: expected ${schema.const}`;
  return typed(value, schema, root, at);
}

function typed(value, schema, root, at) {
  switch (schema.type) {
    case "object": return object(value, schema, root, at);
    case "array": return array(value, schema, root, at);
    case "integer": return Number.isInteger(value) ? "" : `${at}: expected a whole number, found ${value}`;
    case "number": return Number.isFinite(value) ? "" : `${at}: expected a number, found ${value}`;
    case "string": case "boolean": return typeof value === schema.type ? "" : `${at}: expected a ${schema.type}`;
    case "null": return value === null ? "" : `${at}: expected null`;
    default: return "";
  }
}

function object(value, schema, root, at) {
  if (typeof value !== "object" || value === null || Array.isArray(value)) return `${at}: expected an object`;
  const known = schema.properties ?? {};
  for (const name of schema.required ?? []) if (!(name in value)) return `${at}.${name}: missing`;
  for (const [name, inner] of Object.entries(value)) {
    if (!(name in known)) {
      if (schema.additionalProperties === false) return `${at}.${name}: unknown`;
      continue;
    }
    const found = fault(inner, known[name], root, `${at}.${name}`);
    if (found) return found;
  }
  return "";
}

function array(value, schema, root, at) {
  if (!Array.isArray(value)) return `${at}: expected a list`;
  if (schema.prefixItems || !schema.items) return "";
  const looked = value.length > 40 ? [0, value.length - 1] : value.keys();
  for (const place of looked) {
    const found = fault(value[place], schema.items, root, `${at}[${place}]`);
    if (found) return found;
  }
  return "";
}
