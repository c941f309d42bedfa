#include "stages/body_mesh/describe.h"

#include "core/format.h"

namespace mvstudio::stages {

CommandResult Describe(const BodyMeshReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.folder = report.options.out;
  result.outputs = {{report.options.out, "meshes"}};
  result.metrics = {{"frames", report.num_frames}, {"vertices", report.num_vertices}, {"faces", report.num_faces}};
  result.text = Format("%s: %zu meshes of %d vertices, body.mtl and body.png\n", report.options.out.c_str(), report.num_frames,
                       report.num_vertices);
  return result;
}

}  // namespace mvstudio::stages
