#include "avatar/io/pack/run_config.h"
#include "avatar/io/render/bvh_file.h"
#include "tests/support/hostile_readers.h"

namespace mvstudio::testing {
namespace {

std::vector<HostileReader> Readers() {
  return {{"bvh", "bvh/two.bvh", "a.bvh", false, [](const std::string& path) { avatar::ReadBvh(path); }},
          {"config", "run_config/one.json", "config.json", true, [](const std::string& path) { avatar::ReadRunConfig(path); }}};
}

INSTANTIATE_TEST_SUITE_P(All, HostileReaders, ::testing::ValuesIn(Readers()), HostileReaderName);

}  // namespace
}  // namespace mvstudio::testing
