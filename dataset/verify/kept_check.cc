#include "core/disk/kept.h"
#include "dataset/verify/verify_steps.h"

namespace mvstudio::dataset::internal {

std::string BytesOfCheck(const FootageCheck& check, const std::vector<Finding>& findings) {
  KeptWriter out;
  for (const int64_t number : {check.images, check.masks, check.videos, check.frames}) out.Put(number);
  out.Put(check.no_image), out.Put(check.no_mask);
  out.Put<uint64_t>(check.thumbnails.size());
  for (const auto& [frame, thumbnail] : check.thumbnails) out.Put(frame), out.Put(thumbnail);
  out.Put<uint64_t>(findings.size());
  for (const Finding& finding : findings)
    out.Put(finding.severity), out.Put(finding.code), out.Put(finding.path), out.Put(finding.text);
  return out.Take();
}

FootageCheck CheckFromBytes(const std::string& bytes, Findings* findings) {
  KeptReader in(bytes);
  FootageCheck check;
  for (int64_t* number : {&check.images, &check.masks, &check.videos, &check.frames}) *number = in.Get<int64_t>();
  check.no_image = in.Get<int>(), check.no_mask = in.Get<int>();
  for (uint64_t left = in.Count(sizeof(Thumbnail)); left > 0; --left) {
    const int frame = in.Get<int>();
    check.thumbnails[frame] = in.Get<Thumbnail>();
  }
  for (uint64_t left = in.Count(1); left > 0; --left) {
    Finding finding;
    finding.severity = in.Get<Finding::Severity>();
    finding.code = in.Text(), finding.path = in.Text(), finding.text = in.Text();
    findings->Add(finding);
  }
  if (!in.AtEnd()) throw DamagedBytes();
  return check;
}

}  // namespace mvstudio::dataset::internal
