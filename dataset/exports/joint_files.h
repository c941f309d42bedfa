#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dataset/exports/writers.h"
#include "dataset/markers/marker_take.h"

/// Shared by the writers of joint files.
namespace mvstudio::exports {

/// All frame numbers from the first to the last, also those without joints: these files have one line or block per time
/// step. Throws UsageError for gaps that would make up most of the file.
std::vector<int> ContinuousFrames(const Take& take);

/// The joints of a person in a frame; null when absent.
const dataset::Coco19Pose* PoseOf(const Take& take, int frame, int person);

/// The skeleton of the joints that the files hold: the dataset's own, else Panoptic's.
const geometry::Skeleton& SkeletonOf(const Take& take);

/// All joints of SkeletonOf of a person in a frame; nothing when absent.
std::optional<dataset::JointsPose> JointsOf(const Take& take, int frame, int person);

/// The joints of a person over ContinuousFrames.
markers::MarkerTake MarkersOf(const Take& take, int person);

/// Says that the files hold Panoptic's 19 joints, where the dataset has others too.
void NoteJointsBeside(const Job& job);

/// `<sequence>_person0.trc`.
std::string PersonFile(const Take& take, int person, const std::string& extension);

/// World (z up) to the y-up axes of TRC, BVH and glTF viewers: (x, z, -y).
inline Eigen::Vector3d YUp(const Eigen::Vector3d& x_in_world) { return {x_in_world.x(), x_in_world.z(), -x_in_world.y()}; }

}  // namespace mvstudio::exports
