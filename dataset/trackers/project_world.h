#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dataset/pose/pose3d.h"
#include "dataset/trackers/tracked_project.h"
#include "geometry/rigid/rigid3.h"

/// The world and the angles that an anipose project asks for.
namespace mvstudio::dataset {

struct ProjectWorld {
  geometry::Rigid3 new_from_old;
  std::string text;  ///< its axes, in words
};

/// The world of `axes` and `reference_point`: the first axis runs from one point to another, by their medians over the take,
/// the second as nearly so as a right angle allows, the third makes the three right-handed; the origin is the median of the
/// reference point (anipose's documentation, "axes" and "reference_point" of config.toml). Throws FormatError (`path`) for
/// points that the take lacks, and where both directions are nearly one.
ProjectWorld WorldOfProject(const ProjectSettings& settings, const std::vector<JointRow>& rows, const std::string& path);

/// Moves points and covariances.
void MoveTo(const ProjectWorld& world, std::vector<JointRow>* rows);

/// frame,person,angle,value_deg: the angle at the second of three points; rows where one of them is missing are left out.
std::string ProjectAnglesCsv(const ProjectSettings& settings, const std::vector<JointRow>& rows);

}  // namespace mvstudio::dataset
