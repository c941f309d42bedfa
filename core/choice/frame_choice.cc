#include "core/choice/frame_choice.h"

#include <algorithm>
#include <iterator>

namespace mvstudio {
namespace {

void SortOnce(std::vector<int>* numbers) {
  std::sort(numbers->begin(), numbers->end());
  numbers->erase(std::unique(numbers->begin(), numbers->end()), numbers->end());
}

std::string RangeText(int first, int last) {
  return first == last ? "frame " + std::to_string(first) : "frames " + std::to_string(first) + " to " + std::to_string(last);
}

/// The usual step: numbers behind the last frame by less were never filmed.
int StepOf(const std::vector<int>& there) {
  int step = there.size() < 2 ? 1 : there[1] - there[0];
  for (size_t i = 1; i < there.size(); ++i) step = std::min(step, there[i] - there[i - 1]);
  return step;
}

}  // namespace

FrameChoice KnownFrames(const std::string& option, std::vector<int> asked, std::vector<int> there, const std::string& source) {
  SortOnce(&asked), SortOnce(&there);
  FrameChoice choice;
  if (asked.empty()) return choice;
  if (there.empty()) throw NothingLeftError(option + ": " + source + " has no frames");
  const std::string has = "; it has " + std::to_string(there.size()) + " frames from " + std::to_string(there.front()) +
                          " to " + std::to_string(there.back());
  std::set_intersection(asked.begin(), asked.end(), there.begin(), there.end(), std::back_inserter(choice.frames));
  const auto lacks = [&](int first, int last) { return option + ": " + source + " has no " + RangeText(first, last); };
  if (choice.frames.empty()) throw NothingLeftError(lacks(asked.front(), asked.back()) + has);
  const int step = StepOf(there);
  std::string beyond;
  for (size_t begin = 0; begin < asked.size();) {
    size_t end = begin + 1;
    while (end < asked.size() && asked[end] == asked[end - 1] + 1) ++end;
    const int first = asked[begin], last = asked[end - 1];
    const auto found = std::lower_bound(choice.frames.begin(), choice.frames.end(), first);
    if (found == choice.frames.end() || *found > last) throw UsageError(lacks(first, first) + has);
    const auto add = [&](int from, int to) { beyond += (beyond.empty() ? "" : " and ") + RangeText(from, to); };
    if (first <= there.front() - step) add(first, there.front() - 1);
    if (last >= there.back() + step) add(there.back() + 1, last);
    begin = end;
  }
  if (!beyond.empty())
    choice.beyond = option + ": " + source + " has no " + beyond + has + ", which are used as far as asked for";
  return choice;
}

}  // namespace mvstudio
