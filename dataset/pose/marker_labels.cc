#include "dataset/pose/marker_labels.h"

#include <algorithm>
#include <set>
#include <utility>

namespace mvstudio::dataset::internal {
namespace {

/// Subject and marker; the subject is empty where the label names none.
std::pair<std::string, std::string> Parts(const std::string& label) {
  const size_t colon = label.find(':');
  if (colon == std::string::npos || colon + 1 >= label.size()) return {"", label};
  return {label.substr(0, colon), label.substr(colon + 1)};
}

}  // namespace

std::vector<MarkerLabel> SplitLabels(const std::vector<std::string>& labels) {
  std::vector<std::string> subjects;
  std::set<std::pair<int, std::string>> seen;
  std::vector<MarkerLabel> markers;
  for (const std::string& label : labels) {
    const auto [subject, name] = Parts(label);
    auto known = std::find(subjects.begin(), subjects.end(), subject);
    if (known == subjects.end()) known = subjects.insert(known, subject);
    MarkerLabel marker{static_cast<int>(known - subjects.begin()), name};
    for (int number = 2; !seen.insert({marker.person, marker.name}).second; ++number) {
      marker.name = name + "_" + std::to_string(number);
    }
    markers.push_back(std::move(marker));
  }
  return markers;
}

JointTable SplitSubjects(const JointTable& table) {
  std::map<std::pair<int, std::string>, int> numbers;
  JointTable split;
  for (const auto& [frame, persons] : table) {
    for (const auto& [person, joints] : persons) {
      for (const auto& [label, row] : joints) {
        const auto [subject, name] = Parts(label);
        const int number = numbers.emplace(std::pair(person, subject), static_cast<int>(numbers.size())).first->second;
        split[frame][number][name] = row;
      }
    }
  }
  return split;
}

}  // namespace mvstudio::dataset::internal
