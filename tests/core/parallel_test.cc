#include "core/parallel.h"

#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/run_in_copy.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(ParallelFor, CallsEveryIndexOnce) {
  for (const int threads : {0, 1, 2, 7, 100}) {
    for (const int64_t count : {int64_t{0}, int64_t{1}, int64_t{5}, int64_t{10007}}) {
      std::vector<std::atomic<int>> calls(static_cast<size_t>(count));
      ParallelFor(count, threads, [&](int64_t i) { ++calls[static_cast<size_t>(i)]; });
      for (const auto& n : calls) ASSERT_EQ(n, 1) << threads << " threads, " << count;
    }
  }
}

TEST(ParallelFor, ResultDoesNotDependOnThreads) {
  const auto run = [](int threads) {
    std::vector<double> out(5000);
    ParallelFor(5000, threads, [&](int64_t i) {
      double x = 1;
      for (int64_t k = 0; k < i % 100; ++k) x = x * 1.0001 + 1.0 / (1.0 + static_cast<double>(i));
      out[static_cast<size_t>(i)] = x;
    });
    return out;
  };
  EXPECT_EQ(run(1), run(2));
  EXPECT_EQ(run(1), run(5));
}

TEST(ParallelFor, RethrowsTheFirstExceptionAfterAllStopped) {
  for (const int threads : {1, 2, 4}) {
    std::atomic<int> running{0};
    try {
      ParallelFor(1000, threads, [&](int64_t i) {
        ++running;
        if (i == 17) {
          --running;
          throw std::runtime_error("number 17");
        }
        --running;
      });
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(std::string(error.what()), "number 17");
    }
    EXPECT_EQ(running, 0);
  }
}

/// The limit holds for a whole process, so a copy of this one works under it. Address space for a thread or two is left.
int SumWithLittleAddressSpace(int threads) {
  return mvstudio::testing::RunInCopy([threads] {
    uint64_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlim_t limit = pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE)) + (24 << 20);
    const rlimit both = {limit, limit};
    setrlimit(RLIMIT_AS, &both);
    std::atomic<int64_t> sum{0};
    ParallelFor(1000, threads, [&](int64_t i) { sum += i; });
    return sum == 499500 ? 0 : 1;
  });
}

TEST(ParallelFor, GoesOnWithFewerThreadsWhereThereAreNoMore) {
  for (const int threads : {2, 16, 400}) EXPECT_EQ(SumWithLittleAddressSpace(threads), 0) << threads;
}

TEST(ParallelFor, MayBeNested) {
  std::atomic<int> sum{0};
  ParallelFor(4, 2, [&](int64_t) { ParallelFor(10, 2, [&](int64_t j) { sum += static_cast<int>(j); }); });
  EXPECT_EQ(sum, 4 * 45);
}

TEST(ResolveThreads, ZeroMeansTheMachine) {
  EXPECT_GE(ResolveThreads(0), 1);
  EXPECT_EQ(ResolveThreads(3), 3);
}

}  // namespace
}  // namespace mvstudio
