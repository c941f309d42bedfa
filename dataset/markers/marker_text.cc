#include "core/csv.h"
#include "core/fields.h"
#include "core/text/shortest_text.h"
#include "dataset/markers/marker_files.h"

namespace mvstudio::markers {
namespace {

constexpr ChoiceWords<TrcUnit, 2> kTrcUnits = {{{TrcUnit::kMillimetre, "mm"}, {TrcUnit::kMetre, "m"}}};

std::string TrcHeader(const MarkerTake& take, const std::string& file_name, TrcUnit unit) {
  const std::string rate = ShortestText(take.rate_hz), count = std::to_string(take.num_frames());
  std::string text = "PathFileType\t4\t(X/Y/Z)\t" + file_name +
                     "\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n" +
                     rate + "\t" + rate + "\t" + count + "\t" + std::to_string(take.num_markers()) + "\t" +
                     std::string(ToString(unit)) + "\t" + rate + "\t" + std::to_string(take.first_frame + 1) + "\t" + count +
                     "\nFrame#\tTime";
  for (const std::string& name : take.names) text += "\t" + name + "\t\t";
  text += "\n\t";
  for (int m = 1; m <= take.num_markers(); ++m) {
    for (const char* axis : {"X", "Y", "Z"}) text += std::string("\t") + axis + std::to_string(m);
  }
  return text + "\n";
}

}  // namespace

std::string_view ToString(TrcUnit unit) { return WordOf(kTrcUnits, unit); }

void FromString(const std::string& text, TrcUnit* unit) {
  *unit = KnownChoice(kTrcUnits, text, "option 'trc-unit' " + text + ": must be one of mm, m");
}

std::string TrcText(const MarkerTake& take, const std::string& file_name, TrcUnit unit) {
  const double per_metre = unit == TrcUnit::kMetre ? 1 : 1000;
  std::string text = TrcHeader(take, file_name, unit);
  for (int f = 0; f < take.num_frames(); ++f) {
    text += std::to_string(int64_t{take.first_frame} + f + 1) + "\t";
    AppendShortestText(f / take.rate_hz, &text);
    for (int m = 0; m < take.num_markers(); ++m) {
      const size_t i = take.Index(f, m);
      for (const int axis : {1, 2, 0}) {
        text += "\t";
        if (take.source[i] != Source::kMissing) AppendShortestText(per_metre * take.x_in_world[i][axis], &text);
      }
    }
    text += "\n";
  }
  return text;
}

std::string CsvText(const MarkerTake& take) {
  std::string text = "frame,time_s,joint,x_m,y_m,z_m,sigma_m,source\n";
  for (int f = 0; f < take.num_frames(); ++f) {
    for (int m = 0; m < take.num_markers(); ++m) {
      const size_t i = take.Index(f, m);
      if (take.source[i] == Source::kMissing) continue;
      text += std::to_string(int64_t{take.first_frame} + f) + ",";
      AppendShortestText(f / take.rate_hz, &text);
      text += "," + CsvCell(take.names[static_cast<size_t>(m)]);
      for (int k = 0; k < 3; ++k) text += ",", AppendShortestText(take.x_in_world[i][k], &text);
      text += ",";
      if (take.sigma_m[i] > 0) AppendShortestText(take.sigma_m[i], &text);
      text += take.source[i] == Source::kFilled ? ",filled\n" : ",measured\n";
    }
  }
  return text;
}

}  // namespace mvstudio::markers
