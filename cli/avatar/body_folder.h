#pragma once

#include <string>
#include <vector>

#include "avatar/body/files/textured_person.h"
#include "cli/program/command.h"
#include "stages/result.h"

namespace CLI {
class App;
}

namespace mvstudio::cli {

/// A folder with a fitted body: body.npz, body.glb, texture.png (the atlas of its charts) and, where the fit tells how well the
/// surface is known, surface.png.
class BodyFolder {
 public:
  /// Throws UsageError when a body is there and `overwrite` is off.
  BodyFolder(const std::string& path, bool overwrite);

  /// Names of all files, for the right to write them.
  static std::vector<std::string> Names();
  /// All files at once; adds them to the result's outputs.
  void Write(const body::TexturedPerson& person, double frame_rate_hz, stages::CommandResult* result) const;

 private:
  std::string path_;
};

/// `avatar texture` and `avatar edit`, which come with `avatar fit`.
void RegisterAvatarTexture(CLI::App& avatar, Registry& registry);
void RegisterAvatarEdit(CLI::App& avatar, Registry& registry);

}  // namespace mvstudio::cli
