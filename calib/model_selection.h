#pragma once

#include <string>
#include <vector>

#include "calib/holdout.h"

namespace mvstudio::calib {

struct ModelCandidate {
  geometry::LensModel model = geometry::LensModel::kPinhole;
  Holdout holdout;
  bool within_one_se = false;  ///< of the best held-out error
};

struct ModelChoice {
  geometry::LensModel model = geometry::LensModel::kBrown4;
  std::vector<ModelCandidate> candidates;  ///< simplest first
  std::string reason;
};

/// The simplest of pinhole, brown1, brown2, brown4, brown5, rational8 whose held-out error is within one standard error (of the paired
/// differences between views) of the best. brown4 when there are too few views to tell.
ModelChoice ChooseModel(const MonoSolution& solution, int num_folds, int max_views);

}  // namespace mvstudio::calib
