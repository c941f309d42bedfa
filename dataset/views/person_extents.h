#pragma once

#include <map>
#include <string>

#include "dataset/panoptic/panoptic.h"
#include "dataset/views/split.h"

/// What crops and parts of a dataset's images depend on, beside the image itself.
namespace mvstudio::dataset {

/// The person whom most frames show, of several the one with the smallest number; -1: nobody is there.
int MostSeenPerson(const PanopticDataset& dataset);

/// Metres from the middle of a person to the edge of their crops, by person: nearly all poses (98 %, over all cameras) stay
/// inside; the few larger ones lose a little at the border instead of shrinking all others.
std::map<int, double> LargeExtents(const PanopticDataset& dataset);

/// The part that an image of a camera (Panoptic name) in a frame is in.
PartOfSplit PartOf(const Split& split, const std::string& camera, int frame);

}  // namespace mvstudio::dataset
