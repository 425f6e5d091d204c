# Language, warnings and the floating-point rules that the bits depend on.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1")

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

# One home for what every target of ours is compiled with. No contraction into FMA and no fast-math: the state must
# have the same bits on every x86-64 host and in every build type.
add_library(soda_flags INTERFACE)
target_compile_options(soda_flags INTERFACE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor
  -Werror -Wno-restrict -Wno-stringop-overflow # GCC 12 sees overlaps and overflows in std::string that are not there (GCC bug 105651)
  -ffp-contract=off -fno-fast-math)
target_include_directories(soda_flags INTERFACE ${PROJECT_SOURCE_DIR})

set(SODA_SANITIZE "" CACHE STRING "sanitizers, as in -fsanitize=")
if(SODA_SANITIZE)
  add_compile_options(-fsanitize=${SODA_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${SODA_SANITIZE})
endif()
