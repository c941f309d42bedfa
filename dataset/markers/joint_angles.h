#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dataset/markers/marker_take.h"

/// Joint angles of people from joint centres. Axes of segments as the ISB proposes them, x forward, y up, z to the right (Wu et
/// al., J. Biomech. 35, 2002, and 38, 2005; the knee after Grood and Suntay, J. Biomech. Eng. 105, 1983), as far as centres of
/// joints tell them: docs/joint-angles.md.
namespace mvstudio::markers {

struct AngleDefinition {
  std::string name;     ///< "knee_flexion_r"
  std::string opensim;  ///< the coordinate of the same quantity and sign in Rajagopal et al.'s model; empty: there is none
};

/// In the order of every table.
const std::vector<AngleDefinition>& AngleDefinitions();

enum class AngleStatus : uint8_t {
  kOk,
  kMissingJoint,  ///< one of its joints has no position
  kStraightLimb,  ///< the limb is too straight to tell its rotation about itself
  kGimbal,        ///< near the pole of the sequence: only sums of its angles are known
  kNoUp,          ///< nothing is up in this world
  kUncertain,     ///< its deviation exceeds 30 degrees
};
std::string_view ToString(AngleStatus status);  ///< "Ok", "MissingJoint", …

struct Angle {
  double deg = 0;        ///< NaN unless kOk; continuous in time
  double sigma_deg = 0;  ///< NaN where the deviation of a joint is not known
  AngleStatus status = AngleStatus::kMissingJoint;
};

struct AngleTake {
  int person = 0;
  double rate_hz = 0;
  int first_frame = 0;
  std::vector<Angle> angles;  ///< frame by frame, in the order of AngleDefinitions()

  int num_frames() const { return static_cast<int>(angles.size() / AngleDefinitions().size()); }
  const Angle& At(int frame_idx, size_t angle) const {
    return angles[static_cast<size_t>(frame_idx) * AngleDefinitions().size() + angle];
  }
};

/// Covariance (m², world) of a joint in a frame (of the take's numbering); nothing where it is not known.
using CovarianceOf = std::function<std::optional<Eigen::Matrix3d>(int frame, const std::string& joint)>;

/// Joints are found by their names (geometry::JointKey), and by those that .bvh files commonly have. `has_up`: z is up in the
/// world. Deviations follow from the covariances of single joints by central differences, as if the joints erred independently.
AngleTake AnglesOf(const MarkerTake& take, bool has_up, const CovarianceOf& covariance);

/// frame,time_s,angle,value_deg,sigma_deg,status: a row per angle that has a value in some frame, or could have one.
std::string AnglesCsvText(const AngleTake& take);

/// OpenSim's motion file: degrees, a column per coordinate that has a value in some frame; NaN where it has none.
std::string MotText(const AngleTake& take, const std::string& name);

}  // namespace mvstudio::markers
