#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"
#include "calib/calibrate.h"

/// A calibration's solution as its joint adjustment had it, for what it would say of other boards or other unknowns.
namespace mvstudio::stages {

struct SolvedState {
  std::vector<calib::View> views;
  calib::RigState state;
  calib::BundleOptions options;
};

/// Detections of the corners that were kept.
std::vector<calib::Detection> KeptCorners(const calib::CalibrateReport& report);

/// Pose of the first board in each time step.
std::map<int64_t, geometry::Rigid3> BoardPoses(const calib::CalibrateReport& report);

/// `world_from_board`: of every frame among `detections`.
SolvedState StateOf(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards,
                    const std::vector<calib::Detection>& detections, std::map<int64_t, geometry::Rigid3> world_from_board);

/// Whether StateOf has all that was solved for: no late cameras, no boards that move against each other.
bool IsWholeState(const calib::CalibrateReport& report);

}  // namespace mvstudio::stages
