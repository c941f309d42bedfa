#include "dataset/footage/frame_numbers.h"

#include <algorithm>
#include <charconv>
#include <ctime>
#include <filesystem>
#include <optional>
#include <regex>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/disk/paths.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using Spans = std::vector<std::pair<size_t, size_t>>;
using Numbers = std::vector<std::optional<int64_t>>;

constexpr char kDigits[] = "0123456789";

/// Of digits alone; 19 of them hold nanoseconds since 1970. Empty for larger ones.
std::optional<int64_t> WholeOf(std::string_view digits) {
  constexpr int64_t kMost = 9'000'000'000'000'000'000;
  int64_t value = 0;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return code == std::errc() && value <= kMost ? std::optional<int64_t>(value) : std::nullopt;
}

/// The numbers of a text from byte `begin` on, the last first, that some span reaches into.
std::vector<int64_t> NumbersOf(const std::string& text, size_t begin, const Spans& spans) {
  std::vector<int64_t> numbers;
  for (size_t at = text.find_first_of(kDigits, begin); at != std::string::npos; at = text.find_first_of(kDigits, at)) {
    const size_t end = std::min(text.find_first_not_of(kDigits, at), text.size());
    const bool reached = std::any_of(spans.begin(), spans.end(), [&](const auto& s) { return s.first < end && at < s.second; });
    const auto number = reached ? WholeOf(std::string_view(text).substr(at, end - at)) : std::nullopt;
    if (number) numbers.push_back(*number);
    at = end;
  }
  std::reverse(numbers.begin(), numbers.end());
  return numbers;
}

std::string WithoutExtension(const std::string& path) {
  return path.substr(0, path.size() - fs::path(path).extension().string().size());
}

/// The numbers that may be the frame, the last first: of a pattern those that its wildcards reach into.
std::vector<int64_t> CandidatesOf(const std::string& pattern, const std::string& file) {
  const std::string text = WithoutExtension(file);
  const Spans spans = pattern.empty() ? Spans() : WildSpans(file, pattern);
  const std::vector<int64_t> wild = spans.empty() ? std::vector<int64_t>() : NumbersOf(text, 0, spans);
  if (!wild.empty()) return wild;
  return NumbersOf(text, text.size() - fs::path(text).filename().string().size(), {{0, text.size()}});
}

/// Number `place` of every file; empty where one has none.
Numbers AtPlace(const std::vector<std::vector<int64_t>>& candidates, size_t place) {
  Numbers numbers;
  for (const auto& of_file : candidates)
    numbers.push_back(place < of_file.size() ? std::optional<int64_t>(of_file[place]) : std::nullopt);
  return numbers;
}

size_t NumDistinct(const Numbers& numbers) { return std::set<std::optional<int64_t>>(numbers.begin(), numbers.end()).size(); }

constexpr int64_t kDaysTo2000 = 10957;  // since 1970-01-01

/// A time of day in a file's name, with its date and parts of a second where they are there.
struct Clock {
  bool has_date = false, has_part = false;
  int64_t day = 0;  ///< since 2000-01-01
  int64_t second_of_day = 0, millisecond = 0;
};

/// Milliseconds, microseconds or nanoseconds since 1970, of the years 2001 to 2033: they do not fit 32 bits.
std::optional<Clock> EpochOf(const std::string& stem) {
  static const std::regex kEpoch("(?:^|[^0-9])(1[0-9]{9})([0-9]{3})(?:[0-9]{3}){0,2}(?![0-9])");
  std::smatch found;
  if (!std::regex_search(stem, found, kEpoch)) return std::nullopt;
  const int64_t second = std::stoll(found[1].str());
  return Clock{true, true, second / 86400 - kDaysTo2000, second % 86400, std::stoi(found[2].str())};
}

std::optional<Clock> ClockOf(const std::string& file) {
  static const std::regex kClock(
      "(?:(20[0-6][0-9])[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12][0-9]|3[01])[-_. T]{1,3}|(?:^|[^0-9]))"
      "([01][0-9]|2[0-3])[-_.:h ]([0-5][0-9])[-_.:m ]([0-5][0-9])(?:[.,]([0-9]{1,9}))?(?![0-9])");
  const std::string stem = fs::path(file).stem().string();
  std::smatch found;
  if (!std::regex_search(stem, found, kClock)) return EpochOf(stem);
  const auto number = [&](size_t group) { return std::stoi(found[group].str()); };
  Clock clock;
  clock.has_date = found[1].matched, clock.has_part = found[7].matched;
  if (clock.has_date) {
    std::tm date{};
    date.tm_year = number(1) - 1900, date.tm_mon = number(2) - 1, date.tm_mday = number(3);
    clock.day = timegm(&date) / 86400 - kDaysTo2000;
  }
  clock.second_of_day = 3600 * number(4) + 60 * number(5) + number(6);
  if (clock.has_part) clock.millisecond = std::stoi((found[7].str() + "00").substr(0, 3));
  return clock;
}

/// The numbers of names that hold times of day; empty where one has none, where two are alike, or where they need not be
/// frames: without a date, and the last numbers differ in all.
Numbers ByClock(const std::vector<std::string>& files, bool differ) {
  std::vector<Clock> clocks;
  bool parts = false;
  for (const std::string& file : files) {
    const auto clock = ClockOf(file);
    if (!clock || (differ && !clock->has_date)) return {};
    parts = parts || clock->has_part;
    clocks.push_back(*clock);
  }
  Numbers numbers;
  for (const Clock& clock : clocks)
    numbers.push_back(parts ? 1000 * clock.second_of_day + clock.millisecond : 86400 * clock.day + clock.second_of_day);
  return NumDistinct(numbers) == files.size() ? numbers : Numbers();
}

bool AllThere(const Numbers& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](const auto& number) { return number.has_value(); });
}

/// Numbers for those that have none: positions, or after all others where some have one.
FrameNumbers Filled(const Numbers& chosen, size_t place) {
  FrameNumbers result;
  result.by_other_place = place > 0;
  int64_t next = 0;
  for (const auto& number : chosen) next = std::max(next, number.value_or(-1) + 1);
  const bool some = next > 0 && !AllThere(chosen);
  for (const auto& number : chosen) {
    if (some) result.without_number.push_back(!number);
    result.numbers.push_back(number ? *number : next++);
  }
  return result;
}

}  // namespace

std::optional<int64_t> NumberInName(const std::string& path) {
  const std::string stem = fs::path(path).stem().string();
  const auto last = stem.find_last_of(kDigits);
  if (last == std::string::npos) return std::nullopt;
  const auto before = stem.find_last_not_of(kDigits, last);
  return WholeOf(std::string_view(stem).substr(before + 1, last - before));
}

FrameNumbers NumberFrames(const std::string& path_or_pattern, const std::vector<std::string>& files) {
  const bool is_pattern = IsPattern(path_or_pattern);
  std::vector<std::vector<int64_t>> candidates;
  size_t most = 0;
  for (const std::string& file : files) {
    candidates.push_back(CandidatesOf(is_pattern ? path_or_pattern : "", file));
    most = std::max(most, candidates.back().size());
  }
  Numbers chosen = AtPlace(candidates, 0);
  size_t place = 0;
  const bool last_is_constant = AllThere(chosen) && NumDistinct(chosen) == 1;
  for (size_t p = 1; p < most && (is_pattern || last_is_constant) && NumDistinct(chosen) < files.size(); ++p) {
    const Numbers other = AtPlace(candidates, p);
    if (AllThere(other) && NumDistinct(other) == files.size()) chosen = other, place = p;
  }
  const Numbers clocks = ByClock(files, AllThere(chosen) && NumDistinct(chosen) == files.size());
  if (!clocks.empty()) chosen = clocks, place = 0;
  return Filled(chosen, place);
}

}  // namespace mvstudio::dataset
