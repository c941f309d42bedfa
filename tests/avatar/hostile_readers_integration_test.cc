#include "avatar/run/pack/run_config.h"
#include "avatar/splats/files/cloud_file.h"
#include "avatar/splats/files/ply.h"
#include "dataset/pose/bvh_file.h"
#include "tests/support/hostile_readers.h"

namespace mvstudio::testing {
namespace {

std::vector<HostileReader> Readers() {
  return {
      {"bvh", "bvh/two.bvh", "a.bvh", false, [](const std::string& path) { dataset::ReadBvh(path); }},
      {"gaussians", "npz/gaussians.npz", "gaussians.npz", false, [](const std::string& path) { splats::ReadCloud(path, 2); }},
      {"ply", "gaussians_ply/degree3.ply", "a.ply", false, [](const std::string& path) { splats::ReadPly(path); }},
      {"config", "run_config/one.json", "config.json", true, [](const std::string& path) { avatar::ReadRunConfig(path); }}};
}

INSTANTIATE_TEST_SUITE_P(All, HostileReaders, ::testing::ValuesIn(Readers()), HostileReaderName);

}  // namespace
}  // namespace mvstudio::testing
