#pragma once

#include <string>
#include <vector>

#include "stages/input/corner_input.h"
#include "stages/input/pose_input.h"
#include "triangulate/take/take.h"

/// Ways to calibrate or to triangulate that are compared by their speed and accuracy: what a caller gives.
namespace mvstudio::stages {

struct CalibrateTradeoffOptions {
  CornerArguments corners;
  std::vector<std::string> detectors{"fast", "exact"}, models{"auto", "brown1", "brown2", "brown4", "rational8"},
      engines{"mvstudio"};
  std::vector<int> views{0, 12, 6};  ///< time steps that are used; 0: all
  std::string out;                   ///< folder of the figure; empty: none
};

struct TriangulateTradeoffOptions {
  PoseArguments pose;
  triangulate::TakeOptions take;
  std::vector<triangulate::TakeMethod> methods = {
      triangulate::ByPoint(triangulate::PointMethod::kRobust),   triangulate::ByPoint(triangulate::PointMethod::kAllViews),
      triangulate::ByPoint(triangulate::PointMethod::kLost),     triangulate::ByPoint(triangulate::PointMethod::kLinear),
      triangulate::ByPoint(triangulate::PointMethod::kMidpoint), triangulate::ByPoint(triangulate::PointMethod::kDlt)};
  std::vector<std::string> precisions{"double", "float"};
  std::vector<int> views{0, 4, 3, 2}, threads{1, 2};
  std::string out;                 ///< folder of the figure; empty: none
  std::string truth, marker_unit;  ///< empty: none; as the file says
  bool align_truth = false;
};

}  // namespace mvstudio::stages
