#pragma once

#include <string>
#include <utility>
#include <vector>

#include "body/skeleton.h"

/// Hands and faces that whole-body skeletons are put together from. Only for skeleton.cc.
namespace mvstudio::body {

/// Appends the 21 joints of a hand (wrist, then thumb to little finger, each from the palm to the tip; the same in OpenPose,
/// COCO-WholeBody, Halpe and MediaPipe), 20 without its wrist, and its bones. `side` is "L" or "R"; the hand hangs on the
/// skeleton's own wrist.
void AppendHand(const std::string& side, bool with_wrist, Skeleton* skeleton);

/// Appends the first `num_points` (68, or 70 with the pupils) points of a face and its bones; the tip of the nose hangs on
/// "Nose".
void AppendFace(int num_points, Skeleton* skeleton);

/// Pairs (left, right) among the 70 points of a face: the jaw runs from right to left, then brows, nose, eyes, lips, pupils.
/// Sagonas et al., "300 faces in-the-wild challenge", 2013.
const std::vector<std::pair<int, int>>& FaceMirror();

}  // namespace mvstudio::body
