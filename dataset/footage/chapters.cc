#include "dataset/footage/chapters.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <set>

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

bool AreDigits(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool IsVideoName(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension == ".mp4" || extension == ".mov";
}

/// The file of the same recording with this number.
std::string ChapterName(const fs::path& file, int number) {
  const Chapter chapter = *ChapterOf(file.string());
  const bool old = chapter.recording.size() == 8;
  const std::string family = old ? (number == 1 ? "GO" : "GP") : chapter.recording.substr(0, 2);
  const std::string place = old && number == 1 ? "PR" : Format("%02d", old ? number - 1 : number);
  return family + place + chapter.recording.substr(chapter.recording.size() - 4) + file.extension().string();
}

}  // namespace

std::optional<Chapter> ChapterOf(const std::string& path) {
  const std::string stem = fs::path(path).stem().string();
  if (stem.size() != 8 || stem[0] != 'G' || !IsVideoName(path) || !AreDigits(stem.substr(4))) return std::nullopt;
  const std::string family = stem.substr(0, 2), between = stem.substr(2, 2), number = stem.substr(4);
  if (family == "GO" && between == "PR") return Chapter{"GOPR" + number, 1};
  if (!AreDigits(between) || between == "00") return std::nullopt;
  if (family == "GP") return Chapter{"GOPR" + number, std::stoi(between) + 1};
  if (family == "GX" || family == "GH" || family == "GS") return Chapter{family + number, std::stoi(between)};
  return std::nullopt;
}

std::string ChapterPattern(const std::string& path) {
  const auto chapter = ChapterOf(path);
  if (!chapter) return path;
  const bool old = chapter->recording.size() == 8;
  const std::string number = chapter->recording.substr(chapter->recording.size() - 4);
  const std::string name = (old ? "G???" : chapter->recording.substr(0, 2) + "??") + number;
  return (fs::path(path).parent_path() / (name + fs::path(path).extension().string())).string();
}

std::vector<std::string> InChapterOrder(const std::string& pattern, std::vector<std::string> files) {
  const auto number = [](const std::string& file) { return ChapterOf(file)->number; };
  for (const std::string& file : files) {
    const auto chapter = ChapterOf(file), first = ChapterOf(files[0]);
    if (chapter && first && chapter->recording == first->recording) continue;
    throw FormatError(pattern, fs::path(file).filename().string(),
                      "matches several videos that are not the chapters of one GoPro recording (GX010123.MP4, GX020123.MP4, "
                      "…); give one of them");
  }
  std::sort(files.begin(), files.end(), [&](const std::string& a, const std::string& b) { return number(a) < number(b); });
  for (size_t i = 0; i < files.size(); ++i) {
    if (number(files[i]) == static_cast<int>(i) + 1) continue;
    throw FormatError(pattern, fs::path(files[i]).filename().string(),
                      "chapter " + std::to_string(i + 1) + " of the recording is missing: copy it too, its frames count");
  }
  return files;
}

std::vector<std::string> MissingChapters(const std::vector<std::string>& files) {
  std::set<int> there;
  for (const std::string& file : files) {
    if (const auto chapter = ChapterOf(file)) there.insert(chapter->number);
  }
  std::vector<std::string> missing;
  for (int n = 1; !there.empty() && n < *there.rbegin(); ++n) {
    if (there.count(n) == 0) missing.push_back(ChapterName(files[0], n));
  }
  return missing;
}

namespace internal {

double ChapterClock::Place(double time_s) {
  if (!std::isfinite(time_s)) {
    ++count_;
    return time_s;
  }
  if (follows_) shift_s_ = next_s_ - time_s;
  if (count_++ == 0 || follows_) first_s_ = time_s + shift_s_;
  follows_ = false;
  last_s_ = time_s + shift_s_;
  return last_s_;
}

void ChapterClock::NextFile() {
  const double step_s = count_ > 1 ? (last_s_ - first_s_) / static_cast<double>(count_ - 1) : 0;
  next_s_ = last_s_ + step_s;
  count_ = 0;
  follows_ = true;
}

}  // namespace internal

VideoTimes ReadVideoTimes(const std::vector<std::string>& files) {
  internal::ChapterClock clock;
  VideoTimes all;
  for (size_t i = 0; i < files.size(); ++i) {
    const VideoTimes times = ReadVideoTimes(files[i]);
    if (i == 0) all.time_code_s = times.time_code_s;
    for (const double t : times.time_s) all.time_s.push_back(clock.Place(t));
    all.promised += times.promised;
    if (all.cut_short.empty() && !times.cut_short.empty())
      all.cut_short = files.size() > 1 ? fs::path(files[i]).filename().string() + ": " + times.cut_short : times.cut_short;
    clock.NextFile();
  }
  return all;
}

}  // namespace mvstudio::dataset
