// Makes src/gen/*.ts from the contract in idl/ with Debian's protoc and the plugin from node_modules. Generated code is
// not committed: the .proto files are its only source. $PROTOC names another protoc.
import { execFileSync } from 'node:child_process';
import { mkdirSync, rmSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const page = dirname(dirname(fileURLToPath(import.meta.url)));
const idl = join(page, '../../../idl');
const out = join(page, 'src/gen');

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
try {
  execFileSync(
    process.env.PROTOC ?? 'protoc',
    [
      `--plugin=protoc-gen-es=${join(page, 'node_modules/.bin/protoc-gen-es')}`,
      `--es_out=${out}`,
      '--es_opt=target=ts',
      `--proto_path=${idl}`,
      'viewer.proto',
      'action.proto',
      'scene.proto',
    ],
    { stdio: 'inherit' },
  );
} catch (error) {
  console.error(`gen: protoc failed (${error.message}); Debian's package is protobuf-compiler`);
  process.exit(1);
}
