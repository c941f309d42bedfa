#pragma once

#include <string>

/// What a body template holds: what a caller gives.
namespace mvstudio::stages {

struct BodyTemplateOptions {
  std::string source;  ///< "mannequin", a folder of MakeHuman, or a .npz or .pkl file in SMPL's layout
  std::string out;     ///< new .npz file in SMPL's layout; empty: none
};

}  // namespace mvstudio::stages
