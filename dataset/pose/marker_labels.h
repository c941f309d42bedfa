// Private: for the readers of marker files and for comparisons.
#pragma once

#include <string>
#include <vector>

#include "dataset/pose/pose3d_compare.h"

namespace mvstudio::dataset::internal {

struct MarkerLabel {
  int person = 0;
  std::string name;
};

/// "SUBJECT:MARKER" taken apart, as Vicon's Nexus labels markers: subjects become persons by order of appearance, labels
/// without a subject are a person of their own. A name that comes twice in a person gets its number behind it.
std::vector<MarkerLabel> SplitLabels(const std::vector<std::string>& labels);

/// The same for a table, whose joints keep their labels: each of its persons becomes one for every subject in it.
JointTable SplitSubjects(const JointTable& table);

}  // namespace mvstudio::dataset::internal
