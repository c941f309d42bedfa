#pragma once

#include <string>
#include <vector>

#include "dataset/footage/first_number.h"
#include "stages/input/pose_changes.h"

/// Programs that count frames from 1 beside others, and footage, that count from 0.
namespace mvstudio::stages {

/// Frame `first` becomes frame 0. Throws FormatError where the camera has one before it.
void CountFrom(int first, dataset::Pose2dTrack* track);

/// Where cameras stand, for the motion they see; nothing: unknown.
struct NumberingRig {
  const geometry::Rig* rig = nullptr;
  const geometry::Skeleton* skeleton = nullptr;
};

/// By option 'first-frame'; else cameras with frames 1 to N are moved, and said, where their `footage` has N frames from 0, or
/// where other cameras have frames 0 to N - 1. Without footage, and where both sides' programs leave out frames without
/// people, each may have missed one end: then the motion decides (SynchronizeCameras), or it is said alone.
void NumberFromZero(const PoseChanges& changes, const std::vector<NamedPath>& footage,
                    std::vector<dataset::Pose2dTrack>* tracks, InputNotes* notes, const NumberingRig& with = {});

/// Says of `whose` joints that they were moved, or may have to be.
void ReportFirstNumber(dataset::FirstNumber first, const std::string& whose, InputNotes* notes);

}  // namespace mvstudio::stages
