#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/choice/option_style.h"
#include "stages/nets/body_folder.h"
#include "stages/nets/texture/avatar_texture.h"
#include "stages/nets/texture/body_edit.h"

/// The two ways of changing a fitted body: colours made anew, and colours or shape by hand.
namespace mvstudio::stages {

struct TextureRunOptions {
  std::string source;  ///< a training run, or a fitted body with a dataset
  std::string out;     ///< folder
  TextureOptions how;
  double frame_rate_hz = 30;  ///< of the motion in body.glb
  bool overwrite = false;
};

struct EditOptions {
  std::string body;           ///< body.npz or the folder with it
  std::string out;            ///< folder
  std::string image;          ///< texture.png after a paint program; empty: the colours stay
  std::string shape;          ///< NAME=NUMBER,...; empty: it stays
  std::string body_template;  ///< what the body was fitted to, for its blend shapes
  double frame_rate_hz = 30;
  bool overwrite = false;
};

/// A folder with a body that was written.
struct BodyChange {
  std::string out;
  std::vector<std::string> inputs;
  std::optional<SurfaceLimits> surface;
};

struct TextureReport : BodyChange {
  TextureResult made;
};

struct EditReport : BodyChange {
  BodyEdit edit;
};

/// `source`: of OpenTextureSource. Throws UsageError for options that contradict each other and where a body is there already.
TextureReport RunTexture(const TextureSource& source, const TextureRunOptions& options, const RunContext& run);

/// Throws UsageError where nothing is to be changed, and what EditTexture and EditShape throw.
EditReport RunEdit(const EditOptions& options);

CommandResult Describe(const TextureReport& report);
CommandResult Describe(const EditReport& report);

}  // namespace mvstudio::stages
