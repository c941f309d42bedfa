#include "stages/words.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>

#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "core/text/shell_word.h"
#include "core/utf8.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

/// What was probably meant by a path without a name: an image of a pattern that the shell expanded, or a folder of all cameras.
std::string LikelyMeant(const std::string& flag, const std::string& text) {
  constexpr size_t kMostNamed = 4;
  const fs::path path(text);
  const std::string ending = path.extension().string();
  for (const char* of_image : {".jpg", ".jpeg", ".png", ".JPG", ".PNG"}) {
    if (ending == of_image)
      return "; images of one camera are a folder or a pattern in quotes: " + flag + " cam_01='" +
             (path.parent_path() / ("*" + ending)).string() + "'";
  }
  std::error_code error;
  std::vector<std::string> each;
  for (fs::directory_iterator at(path, error), end; !error && at != end; at.increment(error)) {
    if (at->is_directory(error)) each.push_back(ShellWord(at->path().filename().string() + "=" + at->path().string()));
  }
  std::sort(each.begin(), each.end());
  return each.empty() ? "" : "; it holds folders, which are given one by one: " + flag + " " + SomeOf(each, kMostNamed);
}

}  // namespace

std::pair<std::string, std::string> SplitNamePath(const std::string& flag, const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
    const char* const example =
        flag.find("pose2d") == std::string::npos ? " cam_01=videos/cam01.mp4" : " cam_01=pose/cam01_json";
    throw UsageError(flag + " " + text + ": expected NAME=PATH, e.g. " + flag + example +
                     (equals == std::string::npos ? LikelyMeant(flag, text) : ""));
  }
  if (!IsUtf8(text.substr(0, equals))) throw UsageError(flag + " " + text + ": the name is not UTF-8");
  return {text.substr(0, equals), text.substr(equals + 1)};
}

std::string ToString(const NamedPath& named) { return named.name + "=" + named.path; }

void FromString(const std::string& text, const std::string& option, NamedPath* named) {
  const auto [name, path] = SplitNamePath("option '" + option + "'", text);
  *named = {name, path};
}

namespace {

int ParseNumber(const std::string& flag, const std::string& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) {
    throw UsageError(flag + ": '" + text + "' is not a frame number; expected a list such as 0-79,90 or 80-99");
  }
  return value;
}

}  // namespace

std::vector<int> ParseRanges(const std::string& flag, const std::string& text) {
  std::set<int> numbers;
  std::stringstream items(text);
  for (std::string item; std::getline(items, item, ',');) {
    const size_t dash = item.find('-');
    const int first = ParseNumber(flag, item.substr(0, dash));
    const int last = dash == std::string::npos ? first : ParseNumber(flag, item.substr(dash + 1));
    if (last < first || last - first > 10'000'000)
      throw UsageError(flag + ": range '" + item + "' runs backwards or is too long");
    for (int i = 0; i <= last - first; ++i) numbers.insert(first + i);
  }
  return {numbers.begin(), numbers.end()};
}

std::string LengthText(double metres) {
  const double size = std::abs(metres);
  if (!std::isfinite(metres)) return "unknown";
  if (size > 0 && size < 1e-4) return Format("%.3g um", 1e6 * metres);
  return size < 1 ? Format("%.2f mm", 1e3 * metres) : Format(size < 1e5 ? "%.2f m" : "%.3g m", metres);
}

std::string RangesText(const std::vector<int>& numbers) {
  std::string text;
  for (size_t i = 0; i < numbers.size();) {
    size_t end = i + 1;
    while (end < numbers.size() && numbers[end] == numbers[end - 1] + 1) ++end;
    text += (text.empty() ? "" : ",") + std::to_string(numbers[i]);
    if (end - i > 1) text += "-" + std::to_string(numbers[end - 1]);
    i = end;
  }
  return text;
}

std::string Counted(int64_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

}  // namespace mvstudio::stages
