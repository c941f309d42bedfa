#pragma once

#include <string>

#include "stages/body_mesh/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

struct BodyMeshReport {
  BodyMeshOptions options;
  InputNotes notes;
  size_t num_frames = 0;
  int num_vertices = 0, num_faces = 0;
};

/// Writes FRAME_00000000.obj, …, body.mtl and body.png. Throws UsageError for frames that the body has no pose of, FormatError
/// for a body without any, IoError.
BodyMeshReport RunBodyMesh(const BodyMeshOptions& options);

}  // namespace mvstudio::stages
