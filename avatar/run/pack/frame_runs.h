#pragma once

#include <vector>

#include "dataset/panoptic/panoptic.h"

/// Which frames of a dataset follow each other in time.
namespace mvstudio::avatar {

struct AvatarPack;

/// Median difference of neighbouring frame numbers; 1 for fewer than two frames.
int UsualStep(const std::vector<int>& frames);

/// Frames of the dataset in which the person has a pose, ascending.
std::vector<int> FramesOfPerson(const dataset::PanopticDataset& data, int person);

/// Number of frames with a body3DScene file in which the person is not.
int FramesWithout(const dataset::PanopticDataset& data, int person);

/// Frames at which another clip of the person begins, ascending: dataset::FindCuts.
std::vector<int> CutsOf(const dataset::PanopticDataset& data, int person);

/// Sets frame_step and cuts of a pack of `frames`: its rows alone do not say that frames between them are missing, nor where
/// another clip begins. `frame_step` 0: the usual one of `frames`.
void SetTime(const dataset::PanopticDataset& data, int person, std::vector<int> frames, int frame_step, AvatarPack* pack);

}  // namespace mvstudio::avatar
