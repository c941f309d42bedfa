#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dataset/detect/tfjs/tfjs_graph.h"

/// Network weights, downloaded once and kept in a cache folder, each file with its hash.
namespace mvstudio::detect {

/// The package of the weights: fixed version, fixed content.
struct ModelPackage {
  std::string name, version, integrity;  ///< npm's; integrity is "sha512-" and base64
  std::string license;
};
const ModelPackage& PinnedModelPackage();

/// Names of the nets installed from the package: "posenet", "movenet-thunder" (17 COCO keypoints), "selfie" (silhouette of
/// a person).
std::vector<std::string> ModelNames();

/// MVSTUDIO_MODELS, else $XDG_CACHE_HOME/mvstudio/models, else ~/.cache/mvstudio/models. Throws UsageError when none is set.
std::string ModelsFolder();

struct ModelState {
  std::string name;
  std::string path;    ///< of the graph's JSON file
  std::string defect;  ///< "missing", "posenet.bin: SHA-256 differs from the manifest"; empty: sound
  size_t bytes = 0;
};

/// State of every net in `folder` (empty: ModelsFolder()); the hashes are recomputed.
std::vector<ModelState> ListModels(const std::string& folder = "");

/// True when the files exist, so that `ReadModel` does not throw MissingToolError. Hashes are not checked.
bool HasModel(const std::string& name, const std::string& folder = "");

/// Reads a net and checks every byte against the hashes of the manifest. Throws MissingToolError, which explains how to
/// fetch it, when it is not installed; FormatError for a wrong hash; UsageError for an unknown name.
TfjsFiles ReadModel(const std::string& name, const std::string& folder = "");

struct InstallReport {
  std::string folder;
  std::vector<std::string> installed;  ///< files written; empty when all existed
};

/// Installs the nets from the package's tarball. Its SHA-512 is checked before unpacking; only the needed files are
/// extracted; the folder's files are replaced as a whole. Throws IoError, FormatError (another package, damaged),
/// ResourceError.
InstallReport InstallModels(const std::string& tarball, const std::string& folder = "");

/// Same with the tarball fetched by `npm pack` (no script of the package runs). Does nothing when all nets exist and are
/// intact. `poll` is called about 20 times a second; when it throws, npm is ended. Throws MissingToolError without npm, or
/// when npm gets nothing from its registry.
InstallReport FetchModels(const std::string& folder = "", const std::function<void()>& poll = {});

}  // namespace mvstudio::detect
