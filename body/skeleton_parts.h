#pragma once

#include <string>
#include <utility>
#include <vector>

#include "body/skeleton.h"

/// Hands and faces of whole-body skeletons. Only for skeleton.cc.
namespace mvstudio::body {

/// Appends the 21 joints of a hand, 20 without its wrist, and its bones. The order is wrist, then thumb to little finger,
/// each from the palm to the tip; it is the same in OpenPose, COCO-WholeBody, Halpe and MediaPipe. `side` is "L" or "R";
/// the hand is connected to the skeleton's own wrist.
void AppendHand(const std::string& side, bool with_wrist, Skeleton* skeleton);

/// Appends the first `num_points` (68, or 70 with the pupils) points of a face and its bones; the tip of the nose is
/// connected to "Nose".
void AppendFace(int num_points, Skeleton* skeleton);

/// Pairs (left, right) among the 70 points of a face: the jaw runs from right to left, then brows, nose, eyes, lips, pupils.
/// Sagonas et al., "300 faces in-the-wild challenge", 2013.
const std::vector<std::pair<int, int>>& FaceMirror();

}  // namespace mvstudio::body
