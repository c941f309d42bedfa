#pragma once

#include <string>
#include <vector>

#include "avatar/body/measure/body_scores.h"

/// Fitted bodies beside the true surface of a rendered person: what a caller gives.
namespace mvstudio::stages {

struct SurfaceOptions {
  std::vector<std::string> bodies;  ///< body.npz files
  std::string truth;                ///< session of synth, dataset with a folder truth, or that folder
  body::BodyScoreOptions how;
};

/// Without the bodies.
template <class Visitor>
void VisitFields(Visitor&& visit, SurfaceOptions& o) {
  visit("truth", o.truth, "session of synth, dataset with a folder truth, or that folder");
  VisitFields(visit, o.how);
}

}  // namespace mvstudio::stages
