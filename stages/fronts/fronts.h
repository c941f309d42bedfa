#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "core/fields.h"
#include "stages/fronts/growth.h"

/// Ways to do a stage by what they cost and how far off they are.
namespace mvstudio::stages {

inline constexpr char kFrontsSchema[] = "mvstudio.tradeoffs/1";

/// What a way is to a user.
enum class WayMark { kNone, kDefault, kPreset, kPeer };
inline constexpr ChoiceWords<WayMark, 4> kWayMarkWords = {
    {{WayMark::kNone, ""}, {WayMark::kDefault, "default"}, {WayMark::kPreset, "preset"}, {WayMark::kPeer, "peer"}}};
inline std::string_view ToString(WayMark mark) { return WordOf(kWayMarkWords, mark); }

struct FrontWay {
  std::string name;
  WayMark mark = WayMark::kNone;
  std::string command;       ///< as it is typed
  double seconds = NAN;      ///< by the clock
  double cpu_s = NAN;        ///< of all its threads; NaN: not known apart from other work
  double peak_rss_mb = NAN;  ///< MiB
  double stored_kib = NAN;   ///< of what is kept, where that is what memory is elsewhere: a crop in a pack
  double error = NAN;        ///< on held-out data
  std::string why_not;       ///< it gave no figures; empty: it did
  bool time_front = false;   ///< no other way is both cheaper and better
  bool space_front = false;  ///< the same of what is stored, or else of memory

  double time() const { return std::isfinite(cpu_s) ? cpu_s : seconds; }
  double space() const { return std::isfinite(stored_kib) ? stored_kib : peak_rss_mb; }
};

struct StageFront {
  std::string stage;    ///< "calibrate"
  std::string cost;     ///< "processor time (s)"
  std::string error;    ///< with its unit: "rig on held-out boards, RMS (px)"
  std::string space;    ///< "peak memory (MiB)"
  std::string why_not;  ///< nothing could be measured; empty: something was
  std::vector<FrontWay> ways;
};

struct Fronts {
  std::string footage;    ///< "synthetic studio: 4 cameras of 320x240 px, …"
  std::string processor;  ///< the machine's, may be empty
  int cores = 0, threads = 0;
  double load = NAN;  ///< mean number of running processes when it began
  unsigned long long seed = 0;
  std::vector<StageFront> stages;
  std::string grown;  ///< the smallest studio of `growth`
  std::vector<GrowthRow> growth;
};

/// Sets the ways that no other beats, and `why_not` of a stage none of whose ways gave figures.
void MarkFronts(StageFront* front);

std::string FrontsJson(const Fronts& fronts);
/// Throws IoError, FormatError with the place.
Fronts ReadFronts(const std::string& path);

/// One HTML page: two figures and a table for each stage.
std::string FrontsPage(const Fronts& fronts);

}  // namespace mvstudio::stages
