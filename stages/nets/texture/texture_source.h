#pragma once

#include <optional>
#include <string>
#include <vector>

#include "avatar/body/files/textured_person.h"
#include "avatar/body/texture/view_sampler.h"
#include "avatar/run/pack/run_config.h"
#include "core/progress.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::stages {

/// Where a texture comes from.
struct TextureSource {
  dataset::PanopticDataset data;
  int person = -1;
  std::vector<std::string> cameras;  ///< those that were trained on, or that the body was fitted to
  std::vector<int> frames;
  body::TexturedPerson body;
  std::string run_folder;                   ///< empty: the source is a body
  std::optional<avatar::RunConfig> config;  ///< of the run
};

/// A training run with a fitted body, or a fitted body (its file or folder) and option 'dataset'. Throws UsageError, IoError,
/// FormatError.
TextureSource OpenTextureSource(const std::string& path, const std::string& dataset);

/// Images of a turn about the body at rest, by the source's run, `count` of them, `size_px` wide (0: as in training).
std::vector<body::TextureView> RenderTurn(const TextureSource& source, int count, int size_px, const RunContext& run);

}  // namespace mvstudio::stages
