#pragma once

#include <string>
#include <vector>

namespace mvstudio {

/// The candidate that a word was probably meant to be: few letters differ (added, removed, changed, or exchanged with a
/// neighbour), whatever their case. Empty when all are other words.
std::string NearestWord(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace mvstudio
