#include "core/format.h"
#include "dataset/exports/joint_files.h"
#include "dataset/markers/marker_files.h"

namespace mvstudio::exports {

void WriteC3d(const Job& job) {
  RequirePeople(job);
  for (const int person : job.take.PersonIds()) {
    job.Write(PersonFile(job.take, person, ".c3d"), markers::C3dBytes(MarkersOf(job.take, person)));
  }
  const double rounding_mm = 1000 * FloatRoundingM(job.take);
  job.report->figures.emplace_back("max_rounding_mm", rounding_mm);
  constexpr double kWorthSayingMm = 0.05;
  if (rounding_mm > kWorthSayingMm) {
    const std::string text =
        Format("C3D holds single-precision numbers: joints move by up to %.2g mm so far from the origin", rounding_mm);
    job.report->notes.push_back({"EXP-ROUNDED", text, "export trc, csv or npz, or move the world's origin near the people"});
  }
}

}  // namespace mvstudio::exports
