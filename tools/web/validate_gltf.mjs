// Validate GLB files with the Khronos validator and print its issues as JSON:
//   node tools/web/validate_gltf.mjs FILE.glb [FILE.glb ...]
// Exit code 1 where a file has errors.
import { readFile } from "node:fs/promises";
import process from "node:process";
import validator from "gltf-validator";

const reports = [];
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(path)), {
    maxIssues: 50,
  });
  reports.push({ path, issues: report.issues, info: report.info });
}
process.stdout.write(`${JSON.stringify(reports, null, 2)}\n`);
process.exitCode = reports.some((report) => report.issues.numErrors > 0) ? 1 : 0;
