#pragma once

#include <optional>
#include <string>
#include <vector>

#include "avatar/body/files/textured_person.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Scales of surface.png.
struct SurfaceLimits {
  double offset_mm = 0, sigma_mm = 0;
};

/// A folder with a fitted body: body.npz, body.glb, texture.png (the atlas of its charts); where it was posed, its mesh over
/// time (stages/nets/body_motion.h); and, where the fit tells how well the surface is known, surface.png.
class BodyFolder {
 public:
  /// Throws UsageError when a body is there and `overwrite` is off.
  BodyFolder(const std::string& path, bool overwrite);

  /// Names of all files, for the right to write them.
  static std::vector<std::string> Names();
  /// All files at once. The scales where surface.png is among them.
  std::optional<SurfaceLimits> Write(const body::TexturedPerson& person, double frame_rate_hz) const;

 private:
  std::string path_;
};

/// The files of a folder that was written.
CommandResult DescribeBodyFolder(const std::string& path, const std::optional<SurfaceLimits>& surface);

}  // namespace mvstudio::stages
