#pragma once

#include <string>

/// A fitted body as meshes: what a caller gives.
namespace mvstudio::stages {

struct BodyMeshOptions {
  std::string body;  ///< body.npz or the folder with it
  std::string out;   ///< new folder
  std::string frames = "all";
  bool overwrite = false;
};

}  // namespace mvstudio::stages
