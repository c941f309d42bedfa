#pragma once

#include <string>
#include <vector>

#include "calib/holdout.h"

namespace mvstudio::calib {

struct ModelCandidate {
  geometry::LensModel model = geometry::LensModel::kPinhole;
  std::vector<Holdout> holdouts;  ///< per camera
  double relative_error = 0;      ///< RMS over all held-out views of error over the camera's smallest error
  bool within_one_se = false;     ///< of the best candidate
};

struct ModelChoice {
  geometry::LensModel model = geometry::LensModel::kBrown4;
  int index = -1;                          ///< of the chosen candidate; -1 when there were too few views to compare
  std::vector<ModelCandidate> candidates;  ///< simplest first
  std::string reason;
};

/// The simplest of pinhole, brown1, brown2, brown4, brown5, rational8 whose held-out error, over all cameras, is within one
/// standard error (of the paired differences between views) of the best. One model serves all cameras: the views of one camera
/// alone are too few to see a decentring that shifts its principal point, and hence its direction, by a pixel. brown4 when
/// there are too few views.
ModelChoice ChooseModel(const std::vector<MonoSolution>& solutions, int num_folds, int max_views, int num_threads);

}  // namespace mvstudio::calib
