set(MASSETER "@SOURCE@" CACHE PATH "Masseter's source")
set(MASSETER_TARGET "@SOURCE@/target" CACHE PATH "The build folder of Masseter's source")

# Cargo knows whether the library is up to date.
add_custom_target(masseter_c
    COMMAND cargo build --release -p masseter-c --target-dir ${MASSETER_TARGET}
    WORKING_DIRECTORY ${MASSETER} BYPRODUCTS ${MASSETER_TARGET}/release/libmasseter_c.so)
add_library(masseter INTERFACE)
add_dependencies(masseter masseter_c)
target_include_directories(masseter INTERFACE ${MASSETER}/rig/bindings/interface)
target_link_libraries(masseter INTERFACE ${MASSETER_TARGET}/release/libmasseter_c.so)
