#pragma once

#include <string>

#include "avatar/run/evaluate/evaluate.h"

namespace mvstudio::stages {

/// A trained avatar to be scored: what a caller gives.
struct AvatarEvalOptions {
  std::string run_folder;
  avatar::EvaluateOptions scores;
};

template <class Visitor>
void VisitFields(Visitor&& visit, AvatarEvalOptions& o) {
  VisitFields(visit, o.scores);
}

}  // namespace mvstudio::stages
