// Makes src/gen/*.ts from the contract in idl/ with Debian's protoc and the plugin from node_modules. Generated code is
// not committed: the .proto files are its only source. $PROTOC names another protoc.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, renameSync, rmSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const page = dirname(dirname(fileURLToPath(import.meta.url)));
const idl = join(page, '../../../idl');
const out = join(page, 'src/gen');

mkdirSync(out, { recursive: true });
// Beside the old files, which are replaced only where they differ: something else may be reading them.
const made = mkdtempSync(join(page, 'src/gen/new-'));
try {
  execFileSync(
    process.env.PROTOC ?? 'protoc',
    [
      `--plugin=protoc-gen-es=${join(page, 'node_modules/.bin/protoc-gen-es')}`,
      `--es_out=${made}`,
      '--es_opt=target=ts',
      `--proto_path=${idl}`,
      'viewer.proto',
      'action.proto',
      'scene.proto',
    ],
    { stdio: 'inherit' },
  );
  for (const name of readdirSync(made)) {
    const old = join(out, name);
    if (!existsSync(old) || !readFileSync(old).equals(readFileSync(join(made, name)))) renameSync(join(made, name), old);
  }
} catch (error) {
  console.error(`gen: protoc failed (${error.message}); Debian's package is protobuf-compiler`);
  process.exitCode = 1;
} finally {
  rmSync(made, { recursive: true, force: true });
}
